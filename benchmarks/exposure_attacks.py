"""Hostile drives and an independent sound field, for `benchmarks.exposure`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.devices.frame_bytes import PHASE_STEPS, amplitude_of
from midair.model import Drive, Medium, TransducerArray
from midair.physics import Place

ARRAY = TransducerArray.autd3()
Array = NDArray[np.float64]
Single = NDArray[np.complex64]

TABLE = np.array(
    [
        (1.0, 0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
        (1.0, -4.59648054721e-3, -7.87968093807e-4, 1.60125528528e-5),
        (0.891250938, -1.55520765675e-2, -3.07591508224e-4, 2.9747624976e-6),
        (0.707945784, -2.08114779827e-2, -2.18348633296e-4, 2.31910931569e-5),
        (0.501187234, -1.82211227016e-2, 4.7738416141e-4, -1.1901034125e-5),
        (0.354813389, -1.22437497109e-2, 1.20353137658e-4, 6.77743734332e-6),
        (0.251188643, -7.80345575475e-3, 3.23676257958e-4, -5.99548024824e-6),
        (0.199526231, -3.12857467007e-3, 1.43850511e-4, -4.79372835035e-6),
    ]
).T
"""Directivity of a T4010A1 by the old AUTD3 SDK: cubic in the degrees above each multiple of 10, shape (4, 9)."""


def four_units() -> Array:
    """Positions of 2 x 2 AUTD3 units, 18 x 14 transducers less 3 each, 10.16 mm apart, shape (996, 3), in m."""
    holes = {(1, 1), (2, 1), (16, 1)}
    unit = [(10.16e-3 * x, 10.16e-3 * y, 0.0) for y in range(14) for x in range(18) if (x, y) not in holes]
    corners = [(0.192 * x, 0.1514 * y, 0.0) for y in range(2) for x in range(2)]
    positions = np.array([np.add(corner, each) for corner in corners for each in unit])
    return positions - positions.mean(axis=0)


POSITIONS = four_units()


def waves(points: Array, medium: Medium) -> Single:
    """Complex amplitude of each transducer's wave, shape (point, 996), in Pa: 4.386 Pa at 1 m, no code of the check."""
    away = points[:, None] - POSITIONS
    path = np.sqrt((away**2).sum(axis=2))
    degrees = np.degrees(np.arccos(np.clip(away[..., 2] / path, -1, 1)))
    piece = np.clip(np.ceil(degrees / 10).astype(int), 1, 9) - 1
    a, b, c, d = TABLE[:, piece]
    x = degrees - 10 * piece
    strength = 4.385896 * (a + x * (b + x * (c + x * d))) * np.exp(-medium.attenuation * path) / path
    turns = path * (40e3 / medium.speed)
    return (strength * np.exp(2j * np.pi * (turns - np.rint(turns)))).astype(np.complex64)


def direct_sum(q: NDArray[np.complex128], points: Array, medium: Medium) -> Array:
    """Magnitude of the sum of all waves, shape (point, frame), in Pa."""
    found = np.empty((len(points), len(q)))
    for first in range(0, len(points), 512):
        found[first : first + 512] = np.abs(waves(points[first : first + 512], medium) @ q.T.astype(np.complex64))
    return found


def within(place: Place, centres: Array, reach: float, count: int) -> Array:
    """Points of a small grid around each centre, shape (point, 3), moved into the cube of the place."""
    points = (centres[:, None] + _grid(np.linspace(-reach, reach, count))).reshape(-1, 3)
    return np.clip(points, np.array(place.position) - place.reach, np.array(place.position) + place.reach)


def _grid(steps: Array) -> Array:
    return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)


def somewhere(place: Place, count: int, rng: np.random.Generator, *, surface: bool = False) -> Array:
    """Random points in a place's cube: two of three inside, the third (or all) on its surface."""
    share = rng.uniform(-1, 1, (count, 3))
    for number in range(0, count, 1 if surface else 3):
        sides = rng.permutation(3)[: 1 + number // 3 % 3]
        share[number, sides] = rng.choice([-1, 1], len(sides))
    return np.array(place.position) + place.reach * share


def played(phase: Array, level: Array | None = None) -> Drive:
    """A drive at the steps of phase and intensity of the firmware."""
    turn = 2 * np.pi / PHASE_STEPS
    strength = np.ones(len(phase)) if level is None else np.rint(level * 255) / 255
    return Drive(phase=np.rint(phase / turn) * turn, level=strength, rate=1000.0, array=ARRAY)


def sounding(drive: Drive) -> NDArray[np.complex128]:
    """The amplitude and phase that the units emit for a drive, from their pulse widths, shape (frame, transducer)."""
    turn = 2 * np.pi / PHASE_STEPS
    strength = amplitude_of(np.rint(np.asarray(drive.level) * 255).astype(np.uint8)).reshape(drive.frames, -1)
    return strength * np.exp(1j * turn * np.rint(np.asarray(drive.phase) / turn))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """The field at all points and airs of a check, in the strongest modes of the array."""

    basis: NDArray[np.complex128]  # From modes to transducers, shape (transducer, mode)
    power: Array  # Mean power of each mode, ascending
    points: Single  # From modes to pressures, shape (point, mode)

    @classmethod
    def of(cls, matrix: Single, *, modes: int = 180) -> Seen:
        """Decompose a transfer matrix, shape (point, transducer)."""
        power, vectors = np.linalg.eigh((matrix.conj().T @ matrix / len(matrix)).astype(np.complex128))
        basis = vectors[:, -modes:]
        return cls(basis=basis, power=power[-modes:], points=matrix @ basis.astype(np.complex64))


def solved(seen: Seen, wanted: NDArray[np.complex128], *, rounds: int = 6) -> NDArray[np.complex128]:
    """Drives that are loud at one point and as quiet as possible where the check looks, shape (effort, transducer).

    Least squares with weights that follow the loudest points (Lawson), for three penalties on its strength.
    """
    found, there = [], (wanted @ seen.basis).conj()
    for effort in seen.power[-1] * 10.0 ** np.arange(-6, 0, 2):
        weight, made = np.full(len(seen.points), 1 / len(seen.points), np.float32), there
        for _ in range(rounds):
            weighed = np.sqrt(weight)[:, None] * seen.points
            normal = (weighed.conj().T @ weighed).astype(np.complex128)
            normal[np.diag_indices(len(there))] += effort
            made = np.linalg.solve(normal, there)
            made /= there.conj() @ made
            loud = np.abs(seen.points @ made.astype(np.complex64))
            weight *= loud / loud.max() + 1e-4
            weight /= weight.sum()
        found.append(seen.basis @ made)
    q = np.stack(found)
    return q / np.abs(q).max(axis=1, keepdims=True)


def descended(seen: Seen, wanted: Single, start: NDArray[np.complex128], steps: int, *, levels: bool) -> Drive:
    """Optimise drives with Adam to be loud at the wanted points, one per frame, and quiet at the checked points."""
    # Levels are squares of sines, which keeps them between 0 and 1; they start slightly inside.
    begun = np.arcsin(np.sqrt(np.clip(np.abs(start), 0.01, 0.95)))
    turned = np.concatenate([np.angle(start), begun], axis=1)
    pace, size = np.zeros_like(turned), np.zeros_like(turned)
    basis, back = seen.basis.astype(np.complex64), np.ascontiguousarray(seen.points.T)
    for step in range(steps):
        phase, angle = np.split(turned, 2, axis=1)
        level = np.sin(angle) ** 2 if levels else np.ones_like(angle)
        wave = np.exp(1j * phase).astype(np.complex64)
        q = (level * wave).astype(np.complex64)
        field, there = (q @ basis.conj()) @ back, (q * wanted).sum(axis=1, keepdims=True)
        power = np.abs(field) ** 2
        weight = (power / power.max(axis=1, keepdims=True)) ** (4 + 28 * min(1.0, step / (0.7 * steps)))
        # Set negligible weights to 0, because denormal numbers in single precision are slow.
        weight[weight < 1e-9] = 0
        weight /= weight.sum(axis=1, keepdims=True)
        uphill = wanted / there - ((weight / power * field.conj()) @ seen.points) @ basis.conj().T
        slope = np.concatenate([-(uphill * q).imag, (uphill * wave).real * np.sin(2 * angle) * levels], axis=1)
        pace, size = 0.9 * pace + 0.1 * slope, 0.99 * size + 0.01 * slope**2
        rate = 0.15 * (1 - 0.9 * step / steps)
        turned = turned + rate * pace / (1 - 0.9 ** (step + 1)) / (np.sqrt(size / (1 - 0.99 ** (step + 1))) + 1e-8)
    phase, angle = np.split(turned, 2, axis=1)
    return played(phase, np.sin(angle) ** 2 if levels else None)
