"""Gain of the beam, and of the amplitude, from what was re-recorded (paper, 5.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model import Acoustics, Drive, Provenance, TransducerArray
from midair.physics import focus_phase, radiation_pressure, transfer_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamGain:
    """What the sensor reads over what the model says the beam presses: a straight line through >= 5 levels.

    Attributes
    ----------
    gain : float
        Pa read per Pa commanded.
    gain_error : float
        Standard error of `gain`.
    intercept : float
        In Pa; a noise floor shows here.
    curvature : float
        Change of gain from the lowest to the highest level by a parabola through the same points, as a part of
        `gain`; saturation shows here as a negative number.
    residual : float
        Rms distance of the points from the line, in Pa.
    """

    gain: float
    gain_error: float
    intercept: float
    curvature: float
    residual: float


def beam_drive(
    array: TransducerArray,
    point: Array,
    levels: Array,
    *,
    frequency: float = 100.0,
    cycles: int = 20,
    rate: float = 1000.0,
    acoustics: Acoustics | None = None,
) -> Drive:
    """A focus that beats at each level in turn, with which the beam gain is measured.

    The sensor hears no steady pressure, so the pressure is a raised sine: P(t) = level^2 P_full (1 - cos 2 pi f t) / 2.
    Pressure goes with the square of the amplitude, so the drive is its root.

    Parameters
    ----------
    array : TransducerArray
        What plays.
    point : ndarray, shape (3,)
        Place of the focus, in m.
    levels : ndarray, shape (level,)
        Largest drive of each beat, 0 to 1.
    frequency : float
        Frequency of the beat, in Hz; `rate` over it must be whole.
    cycles : int
        Cycles of each level.
    rate : float
        Frames per second, in Hz.
    acoustics : Acoustics, optional
        The air and directivity that the focus is made for.

    Returns
    -------
    Drive
        cycles * rate / frequency frames a level.
    """
    period = rate / frequency
    if abs(period - round(period)) > 1e-9 or period < 4:
        raise InputError(
            f"frequency: expected the rate {rate:g} Hz over a whole number of 4 or more, got {frequency:g} Hz"
        )
    # Begins at 0, so that one level passes into the next without a jump.
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
    array: TransducerArray,
    point: Array,
    levels: Array,
    *,
    acoustics: Acoustics | None = None,
) -> Array:
    """Radiation pressure that the model says a focus has at its point at each level, shape (level,), in Pa."""
    matrix = transfer_matrix(np.reshape(point, (1, 3)), array, acoustics=acoustics)
    return radiation_pressure(np.abs(matrix).sum() * np.asarray(levels, float), (acoustics or Acoustics()).medium)


def beat_amplitude(signal: Array, rate: float, *, frequency: float, parts: int) -> Array:
    """Amplitude of a sine of `frequency` in each of `parts` equal stretches of a signal.

    By correlation with a complex sine over whole cycles; the first quarter of each stretch settles and is left out.

    Parameters
    ----------
    signal : ndarray, shape (frame,)
        Signal of one channel.
    rate : float
        In Hz.
    frequency : float
        In Hz.
    parts : int
        Number of stretches; what is left over at the end is not used.

    Returns
    -------
    ndarray, shape (part,)
        Half peak to peak, in the signal's unit.
    """
    length = len(signal) // parts
    period = rate / frequency
    kept = round(int(0.75 * length / period) * period)
    if kept < period:
        raise ShapeError(f"signal: expected {parts} stretches of at least 2 cycles, got {len(signal)} frames in all")
    sine = np.exp(-2j * np.pi * frequency / rate * np.arange(kept))
    stretches = signal[: parts * length].reshape(parts, length)[:, length - kept :]
    return np.abs(stretches @ sine) * 2 / kept


def beam_gain(commanded: Array, measured: Array) -> BeamGain:
    """The straight line from commanded to measured pressure, with its error and its bend.

    Parameters
    ----------
    commanded, measured : ndarray, shape (level,)
        Amplitude of the pressure's beat at each level, in Pa; five levels at least.

    Raises
    ------
    InputError
        With fewer than five levels, or when nothing was heard.
    """
    commanded, measured = np.asarray(commanded, float), np.asarray(measured, float)
    if commanded.shape != measured.shape or commanded.ndim != 1:
        raise ShapeError(f"measured: expected one value a level {commanded.shape}, got {measured.shape}")
    if len(np.unique(commanded)) < 5:
        raise InputError(f"levels: expected at least 5 different ones, got {len(np.unique(commanded))}; play more")
    design = np.stack([commanded, np.ones_like(commanded)], axis=1)
    (gain, intercept), *_ = np.linalg.lstsq(design, measured, rcond=None)
    rest = measured - design @ (gain, intercept)
    if gain <= 0:
        raise InputError(
            f"measured: expected more pressure at higher levels, got a gain of {gain:g}; is the beam on the sensor?"
        )
    variance = (rest @ rest) / (len(rest) - 2)
    spread = ((commanded - commanded.mean()) ** 2).sum()
    bend, *_ = np.polyfit(commanded, measured, 2)
    return BeamGain(
        gain=float(gain),
        gain_error=float(np.sqrt(variance / spread)),
        intercept=float(intercept),
        # From a x + b x^2 the slope changes by 2 b over the range.
        curvature=float(2 * bend * np.ptp(commanded) / gain),
        residual=float(np.sqrt(np.mean(rest**2))),
    )


def amplitude_gain(measured_gain: float, *, limit: float = 4.0) -> float:
    """Factor on the pressure with which a reproduction of gain `measured_gain` comes out right.

    The paper corrects once, and so does this: 1 / gain, for `prepare(gain=...)`. It is kept within 1/limit and
    limit, so that a silent reproduction cannot ask for endless power.

    Raises
    ------
    InputError
        If the gain is not above zero: then level is not what is wrong.
    """
    if not measured_gain > 0:
        raise InputError(
            f"gain: expected above 0, got {measured_gain:g}; the reproduction does not resemble the original"
        )
    return float(np.clip(1 / measured_gain, 1 / limit, limit))
