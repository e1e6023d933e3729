"""Gain of the beam and gain correction, from re-recordings (paper, 5.2), and correction for another speed of sound."""

from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError, ShapeError
from midair.model import RATE, Acoustics, Drive, Medium, Provenance, TransducerArray
from midair.physics import focus_phase, radiation_pressure, transfer_matrix, wavenumber
from midair.streaming import LazyFrames


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamGain:
    """Linear fit of the measured over the modelled pressure of a beam, through at least 5 levels."""

    gain: float
    """Measured over commanded pressure, Pa/Pa."""
    gain_error: float
    """Standard error of `gain`."""
    intercept: float
    """In Pa; shows a noise floor."""
    curvature: float
    """Relative change of gain from the lowest to the highest level in a quadratic fit; negative for saturation."""
    residual: float
    """Rms distance of the points from the line, in Pa."""


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
    phase = np.broadcast_to(focus_phase(array, point, acoustics=acoustics), (len(level), array.count))
    return Drive(
        phase=phase,
        level=level,
        rate=rate,
        array=array,
        acoustics=acoustics or Acoustics(),
        provenance=Provenance(source="beam test"),
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
    """Fit a line to measured over commanded pressure, with its error and curvature.

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
    bend, *_ = np.polyfit(commanded, measured, 2)
    return BeamGain(
        gain=float(gain),
        gain_error=float(np.sqrt(variance / spread)),
        intercept=float(intercept),
        # The slope of a x + b x^2 changes by 2 b times the range.
        curvature=float(2 * bend * np.ptp(commanded) / gain),
        residual=float(np.sqrt(np.mean(rest**2))),
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
    phase = drive.phase
    lazy = isinstance(phase, LazyFrames)
    return replace(
        drive,
        phase=phase.mapped(lambda block: block - shift) if lazy else phase - shift,
        acoustics=replace(drive.acoustics, medium=room),
        provenance=drive.provenance.then(
            "correct_air", {"from_m_s": drive.acoustics.medium.speed, "to_m_s": room.speed}
        ),
    )
