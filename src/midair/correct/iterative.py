"""Corrections from a re-recording: iterative, frequency by frequency, and by the smallest change of phase.

The iterative correction adds the error of the re-recording to the commanded pressure:

    U <- proj[ U + g conj(H) / (|H|^2 + eps) (Y_target - Y) ]

U is the commanded pressure, Y its re-recording, H the response from one to the other, proj the nearest pressure that
can be played. In iterative learning control this is learning by an inverted model (Bristow, Tharayil and Alleyne, IEEE
Control Systems 26(3), 2006), regularised where H is small.

The minimum-norm correction is the smallest phase change that adds the pressure that a re-recording lacked.
With Y_t = G q_t the field in the middle of frame t, q_t the output of the transducers at that time, c_t their drive,
and w the cells' weights, the pressure on the cells changes by J dtheta with

    J = 2 f w diag(conj(Y_t)) G diag(j c_t), real part,

f the radiation pressure of 1 Pa of sound. This holds for changes that are slow compared with the transducers, which is
true in the sensor's band after compensation of hold and envelope (`targets.precompensate`). The smallest phase change
that adds the pressure r is

    dtheta = J^T (J J^T + l)^-1 r,

a system of the size of the number of cells (Levenberg's step of the underdetermined problem; Nocedal & Wright,
"Numerical Optimization", 2nd edition, section 10.3). It is also the best estimate elsewhere if phase errors of the
transducers are independent. A cell with little pressure has a small slope: l is the slope of a cell with the pressure
`floor`, which limits the change.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from midair.array_types import Array, Complex
from midair.dsp import Band, band_edges, band_window, filter_response
from midair.errors import InputError, ShapeError
from midair.model import ControlGrid, Drive
from midair.physics import TransducerDynamics, envelope, radiation_pressure, transfer_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumNorm:
    """Settings of the correction."""

    floor: float = 0.5
    """Pressure of a cell in Pa below which it is corrected less."""
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    """Envelope dynamics of the transducers."""
    together: int = 64
    """Frames per block."""

    def __post_init__(self) -> None:
        positive(self.floor, "floor of the correction", "Pa")

    def corrected(self, drive: Drive, lacking: Array, weights: Array, grid: ControlGrid) -> Drive:
        """The drive that was played, with more pressure on the cells; silent frames do not change.

        `lacking`, shape (frame, cell), is the pressure to add, in Pa; `weights`, shape (cell, point), are those of
        `cell_weights` with between="waves" for the points of `grid`. Raises ShapeError if frames, cells or points
        differ.
        """
        if lacking.shape != (drive.frames, len(weights)) or weights.shape[1] != grid.count:
            raise ShapeError(
                f"lacking: expected ({drive.frames}, {len(weights)}) with weights of {grid.count} points, got "
                f"{lacking.shape} and {weights.shape}"
            )
        G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics)
        unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
        phase, now = np.array(drive.phase), np.zeros(drive.array.count, complex)
        for first in range(0, drive.frames, self.together):
            part = slice(first, min(first + self.together, drive.frames))
            command = drive.q_of(part)
            # Two moments per frame: its middle, and its end, where the next one starts.
            radiated = envelope(command, drive.rate, 2, self.dynamics, start=now)
            now = radiated[-1]
            phase[part] += _step(lacking[part], weights, G, radiated[::2] @ G.T, command, self.floor / unit) / unit
        return replace(
            drive,
            phase=np.mod(phase, 2 * np.pi),
            provenance=drive.provenance.then("correct the drive", {"floor_pa": self.floor}),
        )


def slopes(weights: Array, G: Complex, field: Complex, command: Complex) -> Array:
    """J of each frame over the radiation pressure of 1 Pa of sound, shape (frame, cell, transducer).

    `weights` (cell, point); G (point, transducer) in Pa; `field` Y (frame, point) in Pa; `command` c (frame,
    transducer) as a fraction of full drive.
    """
    # Single precision: a step need not be exact, and the product with G dominates the time.
    turned = (weights * field.conj()[:, None, :]).astype(np.complex64)
    pulls = (turned.reshape(-1, G.shape[0]) @ G.astype(np.complex64)).reshape(*turned.shape[:2], -1)
    return np.asarray(-2 * (pulls * command[:, None, :]).imag, np.float64)


def _step(lacking: Array, weights: Array, G: Complex, field: Complex, command: Complex, floor: float) -> Array:
    """The smallest phase change of each frame, (frame, transducer), in rad times Pa of radiation over Pa^2 of sound."""
    J = slopes(weights, G, field, command)
    system = J @ J.transpose(0, 2, 1)
    pressed = (np.abs(field) ** 2 @ weights.T).sum(axis=1)
    slope = np.trace(system, axis1=1, axis2=2)
    # Without pressure the slope is 0 and no correction is possible.
    sounds = (pressed > 0) & (slope > 0)
    least = np.where(sounds, floor * slope / np.where(sounds, pressed, 1), 1)
    solved: Any = np.linalg.solve(system + least[:, None, None] * np.eye(len(weights)), lacking[..., None])
    return np.asarray((J.transpose(0, 2, 1) @ solved)[..., 0] * sounds[:, None], np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Transfer function from commanded to re-recorded pressure, the same for all cells."""

    frequency: Array
    """Increasing, in Hz, shape (bin,)."""
    value: Complex
    """H in Pa/Pa, shape (bin,)."""

    def at(self, frequency: Array) -> Complex:
        """H between the bins, by linear interpolation of its real and imaginary parts; constant beyond the ends."""
        real, imaginary = (np.interp(frequency, self.frequency, part) for part in (self.value.real, self.value.imag))
        return np.asarray(real + 1j * imaginary, np.complex128)


def measured_response(asked: Array, heard: Array, rate: float, *, band: Band, resolution: float = 20.0) -> Response:
    """H1 = S_uy / S_uu by Welch's method, the cross-spectra summed over the cells.

    Bins with less than 1e-4 of the strongest bin's power contain no information; they take H of the nearest bin with
    more, and bins outside the band (low, high) are ignored. H is assumed smooth over the spacing of the bins,
    `resolution`; all frequencies are in Hz. `asked` and `heard`, shape (frame, row, column), are the commanded and the
    re-recorded pressure in Pa, at the same times. Raises ShapeError if their shapes differ and InputError if the
    commanded pressure is zero in the band.
    """
    from scipy.signal import csd
    from scipy.signal import welch as scipy_welch

    if asked.shape != heard.shape:
        raise ShapeError(f"heard: expected the shape of the commanded pressure, {asked.shape}, got {heard.shape}")
    segment = min(len(asked), max(8, round(rate / resolution)))
    u, y = asked.reshape(len(asked), -1), heard.reshape(len(heard), -1)
    frequency, power = scipy_welch(u, rate, nperseg=segment, axis=0)
    _, cross = csd(u, y, rate, nperseg=segment, axis=0)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    # Summed before the ratio, so that cells with little pressure do not make it noisy.
    power, cross = power.sum(axis=1) * inside, cross.sum(axis=1)
    if not power.max() > 0:
        raise InputError(f"asked: expected pressure within {band[0]:g} to {band[1]:g} Hz, got none")
    good = np.flatnonzero(power > 1e-4 * power.max())
    nearest = good[np.argmin(np.abs(np.arange(len(frequency))[:, None] - good), axis=1)]
    return Response(
        frequency=np.asarray(frequency, np.float64),
        value=np.asarray((cross[good] / power[good])[np.searchsorted(good, nearest)]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class IterativeCorrection:
    """Settings of the correction."""

    step: float = 0.8
    """g of the first step; 1 would be exact for a linear chain and an exact H."""
    regularisation: float = 0.01
    """eps, over the largest ``|H|^2`` in the band."""
    shrink: float = 0.5
    """Factor on g after a step that increased the error and was undone."""
    smallest: float = 0.1
    """The correction stops below this g."""
    least: float = 0.002
    """Fraction of the error by which a step must lower it to continue."""

    def __post_init__(self) -> None:
        if not (0 < self.smallest <= self.step <= 2 and 0 < self.shrink < 1):
            raise InputError(
                f"correction: expected 0 < smallest <= step <= 2 and 0 < shrink < 1, got {self.smallest:g}, "
                f"{self.step:g} and {self.shrink:g}"
            )
        if self.regularisation < 0 or not 0 <= self.least < 1:
            raise InputError(
                f"correction: expected regularisation >= 0 and 0 <= least < 1, got {self.regularisation:g} and "
                f"{self.least:g}"
            )

    def change(self, lacking: Array, rate: float, response: Response, *, band: Band, step: float) -> Array:
        """Change of the commanded pressure: ``g conj(H) / (|H|^2 + eps)`` applied to the error, within the band.

        `lacking`, shape (frame, row, column), is Y_target - Y at the same times, in Pa; `rate` and the `band` (low,
        high), with the usual soft edges, are in Hz; `response` is H and `step` is g.
        """
        edges = band_edges(band, rate)
        within = (response.frequency >= band[0]) & (response.frequency <= band[1])
        power = np.abs(response.value) ** 2
        floor = self.regularisation * float(power[within].max() if within.any() else power.max())

        def inverse(frequency: Array) -> Complex:
            H = response.at(frequency)
            gain = step * band_window(frequency, band, edges=edges) * np.conj(H) / (np.abs(H) ** 2 + floor)
            return np.asarray(gain, np.complex128).reshape(-1, 1, 1)

        return filter_response(lacking, rate, inverse, reach=0.1)
