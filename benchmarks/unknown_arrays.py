"""Measure arrays that the calibration does not expect: `python -m benchmarks.unknown_arrays`.

Ten arrays of four units: strengths of +-3 dB (normal, standard deviation half of it), resonances uniform within 400 Hz
of the mean, quality factors +-15 %, phases of 0.1 rad besides, 1 % dead, units 0.5 mm, 0.3 degrees and 500 ns out of
place (standard deviations), the sensor 1 mm aside. Recordings come from a forward model of this file: a sum of
spherical waves from its own positions, a directivity interpolated from the published table, transducers integrated at
16 kHz, cells averaged over 1 mm points. The start is not known to the fit, as with a real array.
Only the sensor's electronics and its calibration are midair's. Printed are errors against the truth, the share within
the stated uncertainties, and CPU time.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmarks.clock import load, timed
from midair.calibration import ArrayCodes, ArrayField, ArrayPlan, array_codes, fit_array
from midair.calibration.measure.unit_poses import differences
from midair.model import POSE_AIMS, Acoustics, ArrayCalibration, Medium, TransducerArray
from midair.physics import SensorModel, calibration_of, sense
from midair.solvers import one_blas_thread

ROOM = Acoustics(medium=Medium.at(temperature=22.0, humidity=0.5))
HEIGHT = 0.2
ARRAY = TransducerArray.autd3()
# Relative amplitude of a T4010A1 at 0, 10, ... 90 degrees, as in the emulator of AUTD3.
DIRECTIVITY = PchipInterpolator(
    np.radians(np.arange(0, 91, 10)),
    [1, 1, 1, 0.891250938, 0.707945784, 0.501187234, 0.354813389, 0.251188643, 0.199526231, 0.177827941],
)


@dataclass
class Truth:
    """What only the simulation knows."""

    response: np.ndarray
    pole: np.ndarray
    dead: np.ndarray
    pose: np.ndarray
    sensor: np.ndarray

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and normals of the transducers, moved with their units."""
        position, normal = ARRAY.position.copy(), ARRAY.normal.copy()
        for unit, pose in enumerate(self.pose):
            own, turn = ARRAY.unit == unit, Rotation.from_rotvec(pose[3:6])
            middle = position[own].mean(axis=0)
            position[own] = turn.apply(position[own] - middle) + middle + pose[:3]
            normal[own] = turn.apply(normal[own])
        return position, normal

    @property
    def emitted(self) -> np.ndarray:
        """Complex amplitude of each transducer at full drive, with the delay of its unit."""
        delay = self.pose[ARRAY.unit, 6]
        return np.where(self.dead, 0, self.response * np.exp(2j * np.pi * ARRAY.frequency * delay))


def draw(seed: int) -> Truth:
    """One array of the distribution in the text above."""
    rng, count, units = np.random.default_rng((31, seed)), ARRAY.count, 4
    strength = 0.9 * 10 ** (1.5 * rng.standard_normal(count) / 20)
    resonance = 200 + rng.uniform(-400, 400, count)
    tau = 188e-6 * np.clip(1 + 0.15 * rng.standard_normal(count), 0.4, None)
    pole = -1 / tau + 2j * np.pi * resonance
    late = np.exp(0.1j * rng.standard_normal(count))
    scale = np.array([*[0.5e-3] * 3, *np.radians([0.3] * 3), 500e-9])
    return Truth(
        response=strength * (-1 / 188e-6 + 400j * np.pi) / pole * late,
        pole=pole,
        dead=rng.random(count) < 0.01,
        pose=scale * rng.standard_normal((units, 7)),
        sensor=np.array([*1e-3 * rng.standard_normal(2), HEIGHT + 0.5e-3 * rng.standard_normal()]),
    )


def field(points: np.ndarray, truth: Truth, medium: Medium) -> np.ndarray:
    """Pressure of each transducer at each point, shape (point, transducer)."""
    position, normal = truth.places
    away = points[:, None] - position
    far = np.linalg.norm(away, axis=2)
    angle = np.arccos(np.clip((away * normal).sum(axis=2) / far, -1, 1))
    k = 2 * np.pi * ARRAY.frequency / medium.speed
    return ARRAY.pressure * DIRECTIVITY(angle) * np.exp((1j * k - medium.attenuation) * far) / far * truth.emitted


def record(
    codes: ArrayCodes, truth: Truth, model: SensorModel, *, seed: int, medium: Medium = ROOM.medium
) -> np.ndarray:
    """Volts of the sensor, shape (frame, channel), while the array plays the codes."""
    steps, reach = 16, 8
    x = np.arange(-reach, reach + 1) * 1e-3
    # The outermost of nine points of 1 mm count half for a cell of 8 mm.
    window = gaussian_filter1d(np.where(np.abs(np.abs(x) - 4e-3) < 1e-6, 0.5, np.abs(x) < 4e-3), model.spread / 1e-3)
    weight = np.outer(window, window).ravel() / 64
    grids = []
    for cell in codes.cells:
        middle = truth.sensor + np.array([*model.grid.channel_position(cell), 0])
        flat = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
        grids.append(middle + np.column_stack([flat, np.zeros(len(flat))]))
    near = weight > 1e-3 * weight.max()
    weight = weight[near]
    G = field(np.concatenate([grid[near] for grid in grids]), truth, medium).astype(np.complex64)
    decay = np.exp(truth.pole[:, None] * np.arange(1, steps + 1) / (steps * codes.rate)).T
    phase = codes.phase
    q = codes.level * np.exp(1j * phase[0])
    felt = np.zeros((codes.frames * steps, model.grid.count))
    for first in range(0, codes.frames, 50):
        block = []
        for drive in codes.level * np.exp(1j * phase[first : first + 50]):
            block.append(drive + (q - drive) * decay)
            q = block[-1][-1]
        sound = np.concatenate(block).astype(np.complex64) @ G.T
        power = ROOM.medium.alpha * np.abs(sound) ** 2 / (2 * medium.density * medium.speed**2)
        each = power.reshape(len(sound), len(codes.cells), -1) @ weight
        felt[first * steps : first * steps + len(each), list(codes.cells)] = each
    felt = felt.reshape(-1, *model.grid.shape)
    return sense(model, felt, codes.rate, rng=np.random.default_rng(seed), oversample=steps).reshape(
        len(felt) // steps, -1
    )


def measured(seed: int, seconds: float) -> tuple[list[str], dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Lines about the calibration of a simulated array, and its scores."""
    truth, model = draw(seed), SensorModel().with_spread(seed=seed)
    codes = array_codes(ARRAY, model.grid, ArrayPlan(duration=seconds), acoustics=ROOM, height=HEIGHT)
    assumed = ArrayField(array=ARRAY, codes=codes, acoustics=ROOM, calibration=calibration_of(model), height=HEIGHT)
    with one_blas_thread():
        volts = record(codes, truth, model, seed=seed)
        found, cost = timed(lambda: fit_array(assumed, volts, synchronous=False))
        missed, wrong = (truth.dead & ~found.dead).sum(), (found.dead & ~truth.dead).sum()
        left = found.provenance.last("fit array")["noise_ratio"]
        lines = [
            f"array {seed}: {truth.dead.sum()} dead, {missed} missed, {wrong} wrongly; remainder {left:.2f} times "
            f"the noise; {cost / 1e3:.0f} s of CPU",
            *(f"  not told apart: {names}, {times:.1f} times the aim" for names, times in found.inseparable().items()),
        ]
    return lines, scores(truth, found)


def scores(truth: Truth, found: ArrayCalibration) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Errors and standard uncertainties by name, without the level, the phase and the place that cannot be measured."""
    alive = ~(truth.dead | found.dead)
    # The truth at the sensor, over the nominal field there.
    at = truth.sensor[None]
    nominal = field(
        at, replace(truth, pose=np.zeros((4, 7)), response=np.ones(ARRAY.count), dead=truth.dead & False), ROOM.medium
    )
    secret = (field(at, truth, ROOM.medium) / nominal)[0]
    ratio = found.response[alive] / secret[alive]
    level = np.median(np.abs(ratio))
    phase = np.angle(ratio * np.exp(-1j * np.angle(ratio.sum())))
    # A displaced sensor has the same effect as these three patterns.
    way = truth.sensor - ARRAY.position[alive]
    pattern = np.column_stack([way / np.linalg.norm(way, axis=1, keepdims=True), np.ones(alive.sum())])
    phase -= pattern @ np.linalg.lstsq(pattern, phase, rcond=None)[0]
    resonance = ARRAY.frequency + truth.pole.imag / (2 * np.pi)
    quality = -np.pi * resonance / truth.pole.real
    pose, _ = differences(ARRAY, truth.pose, np.zeros((28, 28)))
    off = found.pose - pose
    return {
        "strength, %": (
            100 * (np.abs(ratio) / level - 1) * np.abs(secret[alive]),
            100 * found.strength_uncertainty[alive],
        ),
        "phase, rad": (phase, found.phase_uncertainty[alive]),
        "resonance, Hz": ((found.resonance - resonance)[alive], found.resonance_uncertainty[alive]),
        "quality, %": (100 * (found.quality / quality - 1)[alive], 100 * found.quality_uncertainty[alive]),
        "x and y of units, mm": (1e3 * off[:, :2], 1e3 * found.pose_uncertainty[:, :2]),
        "z of units, mm": (1e3 * off[:, 2], 1e3 * found.pose_uncertainty[:, 2]),
        "angles of units, deg": (np.degrees(off[:, 3:6]), np.degrees(found.pose_uncertainty[:, 3:6])),
        "time of units, ns": (1e9 * off[:, 6], 1e9 * found.pose_uncertainty[:, 6]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.unknown_arrays", description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=list(range(10)), help="arrays (default 0 to 9)")
    parser.add_argument("--seconds", type=float, default=8.0, help="duration of the codes in s (default 8)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    options = parser.parse_args()
    print(load())
    together: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    with ProcessPoolExecutor(options.jobs) as pool:
        for lines, errors in pool.map(measured, options.seeds, [options.seconds] * len(options.seeds)):
            print(*lines, sep="\n", flush=True)
            for name, (error, sure) in errors.items():
                together.setdefault(name, []).append((error.ravel(), sure.ravel()))
    print(f"aims for units: {1e3 * POSE_AIMS[0]:g} mm, {np.degrees(POSE_AIMS[3]):g} deg, {1e9 * POSE_AIMS[6]:g} ns")
    for name, parts in together.items():
        error, sure = (np.concatenate(each) for each in zip(*parts, strict=True))
        rms, within = np.sqrt(np.mean(error**2)), 100 * np.mean(np.abs(error) < 2 * sure)
        print(f"{name:22} rms error {rms:.3g}, k = 1 {np.median(sure):.3g}, {within:.1f} % within k = 2")


if __name__ == "__main__":
    main()
