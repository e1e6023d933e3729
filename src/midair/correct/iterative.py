"""Corrections from a re-recording: gains (paper, 5.2), iterative, by frequency, and by the smallest change of phase.

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

The drive can also be corrected for another speed of sound.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.dsp import Band, band_edges, band_window, filter_response
from midair.errors import InputError, ShapeError
from midair.model import RATE, Acoustics, ControlGrid, Drive, Medium, Provenance, TransducerArray
from midair.physics import TransducerDynamics, envelope, focus_phase, radiation_pressure, transfer_matrix, wavenumber
from midair.streaming import each_frame
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamGain:
    """Linear fit of the measured over the modelled pressure of a beam, through at least 5 levels."""

    gain: float
    """Measured over commanded pressure, Pa/Pa."""
    gain_error: float
    """Standard error of `gain`."""
    intercept: float
    """In Pa; shows a noise floor."""


def beam_drive(
    array: TransducerArray,
    point: Array,
    levels: Array,
    *,
    frequency: float = 100.0,
    cycles: int = 20,
    rate: float = RATE,
    acoustics: Acoustics | None = None,
) -> Drive:
    """A focus whose pressure oscillates at each level in turn, to measure the beam gain.

    The sensor does not measure steady pressure, so the pressure is a raised sine: P(t) = level^2 P_full (1 - cos 2 pi f
    t) / 2. Pressure is proportional to the squared amplitude, so the drive is its root. The drive has cycles * rate /
    frequency frames per level, of which rate / frequency must be whole; both are in Hz. `point`, shape (3,), is the
    position of the focus in m, `levels` the maximum drive at each level, 0 to 1.
    """
    period = rate / frequency
    if abs(period - round(period)) > 1e-9 or period < 4:
        raise InputError(
            f"frequency: expected the rate {rate:g} Hz over a whole number of 4 or more, got {frequency:g} Hz"
        )
    # Begins at 0, so that there is no jump between levels.
    beat = np.sqrt((1 - np.cos(2 * np.pi * np.arange(cycles * round(period)) / period)) / 2)
    level = (np.asarray(levels, float)[:, None] * beat).ravel()
    return focused_drive(array, point, level, rate=rate, acoustics=acoustics, source="beam test")


def focused_drive(
    array: TransducerArray, point: Array, level: Array, *, rate: float, acoustics: Acoustics | None = None, source: str
) -> Drive:
    """A drive that holds a focus at a point, shape (3,), in m; `level` as in `Drive`, `rate` in frames per second."""
    return Drive(
        phase=np.broadcast_to(focus_phase(array, point, acoustics=acoustics), (len(level), array.count)),
        level=level,
        rate=rate,
        array=array,
        acoustics=acoustics or Acoustics(),
        provenance=Provenance(source=source),
    )


def commanded_pressure(
    array: TransducerArray, point: Array, levels: Array, *, acoustics: Acoustics | None = None
) -> Array:
    """Modelled radiation pressure at the focus for each level, shape (level,), in Pa."""
    matrix = transfer_matrix(np.reshape(point, (1, 3)), array, acoustics=acoustics)
    return radiation_pressure(np.abs(matrix).sum() * np.asarray(levels, float), (acoustics or Acoustics()).medium)


def sine_amplitude(signal: Array, rate: float, *, frequency: float, parts: int) -> Array:
    """Amplitude of a sine of `frequency` in each of `parts` equal parts of a signal, shape (part,), half peak to peak.

    Correlation with a complex sine over whole cycles; the first quarter of each part is left out as settling time, and
    remaining frames at the end are ignored. `signal`, shape (frame,), is one channel; `rate` and `frequency` are in Hz.
    """
    length = len(signal) // parts
    period = rate / frequency
    kept = round(int(0.75 * length / period) * period)
    if kept < period:
        raise ShapeError(f"signal: expected {parts} parts of at least 2 cycles, got {len(signal)} frames in total")
    sine = np.exp(-2j * np.pi * frequency / rate * np.arange(kept))
    stretches = signal[: parts * length].reshape(parts, length)[:, length - kept :]
    return np.abs(stretches @ sine) * 2 / kept


def beam_gain(commanded: Array, measured: Array) -> BeamGain:
    """Fit a line to measured over commanded pressure, with its error.

    Both are the amplitude of the pressure's oscillation at each level, shape (level,), in Pa. Raises InputError with
    fewer than five levels, or a gain that is not above zero.
    """
    commanded, measured = np.asarray(commanded, float), np.asarray(measured, float)
    if commanded.shape != measured.shape or commanded.ndim != 1:
        raise ShapeError(f"measured: expected one value per level {commanded.shape}, got {measured.shape}")
    if len(np.unique(commanded)) < 5:
        raise InputError(
            f"levels: expected at least 5 different ones, got {len(np.unique(commanded))}; play more levels"
        )
    design = np.stack([commanded, np.ones_like(commanded)], axis=1)
    (gain, intercept), *_ = np.linalg.lstsq(design, measured, rcond=None)
    rest = measured - design @ (gain, intercept)
    if gain <= 0:
        raise InputError(
            f"measured: expected more pressure at higher levels, got a gain of {gain:g}; focus the beam on the sensor"
        )
    variance = (rest @ rest) / (len(rest) - 2)
    spread = ((commanded - commanded.mean()) ** 2).sum()
    return BeamGain(
        gain=float(gain),
        gain_error=float(np.sqrt(variance / spread)),
        intercept=float(intercept),
    )


def amplitude_gain(measured_gain: float, *, limit: float = 4.0) -> float:
    """Factor on the pressure that corrects a reproduction of gain `measured_gain`.

    The paper corrects once: 1 / gain, for `prepare(gain=...)`. It is limited to 1/limit and limit, so that a very weak
    reproduction does not lead to extreme levels. Raises InputError if the gain is not above zero: then the level is not
    the problem.
    """
    if not measured_gain > 0:
        raise InputError(
            f"gain: expected above 0, got {measured_gain:g}; the reproduction does not resemble the original"
        )
    return float(np.clip(1 / measured_gain, 1 / limit, limit))


def correct_air(drive: Drive, room: Medium, centre: Array) -> Drive:
    """Change the phases of a drive so that its waves arrive at one point as they do in the air it was solved for.

    ``phase_i - (k_room - k_solved) d_i``, with d_i the distance of transducer i from the point `centre` (m), such as
    the centre of the control points, and k = 2 pi f / c. The correction is exact at the point and approximate around
    it; levels do not change. The result is a drive for the air of the room.
    """
    change = wavenumber(drive.array, room) - wavenumber(drive.array, drive.acoustics.medium)
    shift = change * np.linalg.norm(drive.array.position - centre, axis=1)
    return replace(
        drive,
        phase=each_frame(drive.phase, lambda block: block - shift),
        acoustics=replace(drive.acoustics, medium=room),
        provenance=drive.provenance.then(
            "correct_air", {"from_m_s": drive.acoustics.medium.speed, "to_m_s": room.speed}
        ),
    )


def minimum_norm(
    drive: Drive,
    lacking: Array,
    weights: Array,
    grid: ControlGrid,
    *,
    floor: float = 0.5,
    dynamics: TransducerDynamics | None = None,
    together: int = 64,
) -> Drive:
    """The drive that was played, with more pressure on the cells; silent frames do not change.

    `lacking`, shape (frame, cell), is the pressure to add, in Pa; `weights`, shape (cell, point), are those of
    `cell_weights` with between="waves" for the points of `grid`. Cells below a pressure of `floor`, in Pa, are
    corrected less; `dynamics` is the envelope of the transducers, `together` the number of frames per block. Raises
    ShapeError if frames, cells or points differ.
    """
    positive(floor, "floor of the correction", "Pa")
    if lacking.shape != (drive.frames, len(weights)) or weights.shape[1] != grid.count:
        raise ShapeError(
            f"lacking: expected ({drive.frames}, {len(weights)}) with weights of {grid.count} points, got "
            f"{lacking.shape} and {weights.shape}"
        )
    G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics)
    unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
    phase, now = np.array(drive.phase), np.zeros(drive.array.count, complex)
    for first in range(0, drive.frames, together):
        part = slice(first, min(first + together, drive.frames))
        command = drive.q_of(part)
        # Two moments per frame: its middle, and its end, where the next one starts.
        radiated = envelope(command, drive.rate, 2, dynamics or TransducerDynamics(), start=now)
        now = radiated[-1]
        phase[part] += _step(lacking[part], weights, G, radiated[::2] @ G.T, command, floor / unit) / unit
    return replace(
        drive,
        phase=np.mod(phase, 2 * np.pi),
        provenance=drive.provenance.then("correct the drive", {"floor_pa": floor}),
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
    if asked.shape != heard.shape:
        raise ShapeError(f"heard: expected the shape of the commanded pressure, {asked.shape}, got {heard.shape}")
    segment = min(len(asked), max(8, round(rate / resolution)))
    u, y = asked.reshape(len(asked), -1), heard.reshape(len(heard), -1)
    frequency, power = scipy.signal.welch(u, rate, nperseg=segment, axis=0)
    _, cross = scipy.signal.csd(u, y, rate, nperseg=segment, axis=0)
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
