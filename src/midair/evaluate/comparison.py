"""Compare an original pressure with its reproduction: waveform, level and place."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.errors import MismatchError, RateError
from midair.evaluate.distortion import OVERALL, TOUCHED, Limits, advance, distortion_ratios, find_delay
from midair.evaluate.place import Place, fit_place
from midair.model import PressureFrames, Shown
from midair.validation import checked_call


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison(Shown):
    """Figures of a reproduction; there is no single score."""

    delay: float
    """Delay of the reproduction in s, removed before all other figures."""
    correlation: float
    """Correlation of the waveforms over all channels, -1 to 1, without subtracting the mean."""
    place: Place
    """Where the pattern lies; correlation, gain and ratios are those against the original there."""
    gain: float
    """Slope of the best line through 0 from original to reproduced pressure."""
    waveform_error: float
    """||reproduced - original|| / ||original||, without fitting a place or a gain."""
    distortion_ratio: float
    """Signal-to-distortion ratio over all cells with one gain, in dB."""
    ratios: Mapping[str, Limits]
    """Each signal-to-distortion ratio by its name, see `RATIOS`; without noise only where that is known."""
    frequency: tuple[float, float]
    """Dominant frequency, original and reproduced, in Hz."""
    rms: tuple[float, float]
    """Rms of the strongest cell, original and reproduced, in Pa."""
    channel_correlation: Array
    """Shape (row, column); 0 where the original is silent."""
    channel_gain: Array
    """Shape (row, column); 0 where the original is silent."""
    simulated: bool
    """Whether any part was simulated."""

    def figures(self) -> dict[str, tuple[float, str]]:
        """Every scalar figure with its unit, by its label in reports."""
        return {
            "correlation": (self.correlation, ""),
            "gain": (self.gain, ""),
            "waveform error": (100 * self.waveform_error, "%"),
            **{name: (ratio[0], "dB") for name, ratio in self.ratios.items()},
            "shift of the pattern": (1e3 * self.place.distance, "mm"),
            "turn of the pattern": (float(np.degrees(self.place.turn)), "deg"),
            "dominant frequency, original": (self.frequency[0], "Hz"),
            "dominant frequency, reproduced": (self.frequency[1], "Hz"),
            "rms of the strongest cell, original": (self.rms[0], "Pa"),
            "rms of the strongest cell, reproduced": (self.rms[1], "Pa"),
            "delay": (1e3 * self.delay, "ms"),
        }

    @property
    def fidelity(self) -> float:
        """Signal-to-distortion ratio of the verdict in dB: of the touched cells, without known noise."""
        return self.ratios.get(f"{TOUCHED}, without noise", self.ratios[TOUCHED])[0]

    def __repr__(self) -> str:
        said = f"correlation {self.correlation:.3f}, gain {self.gain:.3g}, {self.fidelity:.1f} dB on the touched cells"
        return f"<Comparison {said}, {self.place or 'in place'}{', SIMULATED' if self.simulated else ''}>"


@checked_call
def compare(
    original: PressureFrames,
    reproduced: PressureFrames,
    *,
    first: int = 0,
    noise: Array | None = None,
    fixed_place: bool = False,
) -> Comparison:
    """Compare a reproduction with its original.

    Parameters
    ----------
    original, reproduced : PressureFrames
        Pressures of the same cells at the same rate; the shorter one sets the number of compared frames.
    first : int
        Frame of the reproduction at which the original begins; everything before and after is ignored. If the
        reproduction was cut before its delay was known, samples at its ends are missing, and even a perfect one reaches
        only 30 to 50 dB.
    noise : ndarray, shape (row, column), optional
        Rms noise of the sensor in the reproduction, in its band, in Pa.
    fixed_place : bool
        Count a rigid shift and turn of the pattern as distortion.

    Raises
    ------
    MismatchError
        If the sensors have different cells, or the first was played and re-recorded and the second was not.
    RateError
        If the rates differ.
    """
    check_alike(original, reproduced)
    frames = min(original.frames, reproduced.frames - first)
    part, x, shape = slice(first, first + frames), original.pressure[:frames], original.sensor.shape
    delay = find_delay(x, reproduced.pressure[part], original.rate)
    # The delay is removed before all figures: half a period of delay would invert a wave.
    y = advance(reproduced.pressure, delay, original.rate)[part]
    place, moved = (Place(), x) if fixed_place else fit_place(x, y, original.sensor)
    plain, a, b = (each.reshape(frames, -1) for each in (x, moved, y))
    xx, yy, xy = _products(a, a), _products(b, b), _products(a, b)
    gain, own = _over(xy.sum(), xx.sum()), _over(xy, xx)
    before_place = _products(plain, plain)
    low, high = original.band or (0.0, original.rate / 2)
    values = 2 * (high - low) * frames / original.rate
    # As a difference of sums the residual would be lost to rounding for a good reproduction.
    apart = _products(b - own * a, b - own * a)
    found = distortion_ratios(xx, own, float(gain), apart, noise=noise, frames=frames, values=values)
    return Comparison(
        delay=delay,
        correlation=float(_over(xy.sum(), np.sqrt(xx.sum() * yy.sum()))),
        place=place,
        gain=float(gain),
        waveform_error=_ratio(np.sqrt(_products(b - plain, b - plain).sum()), np.sqrt(before_place.sum())),
        distortion_ratio=found[OVERALL][0],
        ratios=found,
        frequency=(dominant_frequency(x, original.rate), dominant_frequency(y, original.rate)),
        rms=(float(np.sqrt(before_place.max() / frames)), float(np.sqrt(yy.max() / frames))),
        channel_correlation=_over(xy, np.sqrt(xx * yy)).reshape(shape),
        channel_gain=own.reshape(shape),
        simulated=original.provenance.simulated or reproduced.provenance.simulated,
    )


def dominant_frequency(samples: Array, rate: float) -> float:
    """Frequency in Hz of the strongest Fourier component of samples (frame, ...), all channels together."""
    power = np.zeros(len(samples) // 2 + 1)
    for channel in samples.reshape(len(samples), -1).T:
        power += np.abs(np.fft.rfft(channel - channel.mean())) ** 2
    return float(np.fft.rfftfreq(len(samples), 1 / rate)[int(np.argmax(power))])


def _products(x: Array, y: Array) -> Array:
    """Sum over the frames for each channel, shape (channel,)."""
    return np.asarray(np.einsum("tc,tc->c", x, y), np.float64)


def check_alike(original: PressureFrames, reproduced: PressureFrames) -> None:
    """Raise an error for different cells or swapped arguments (MismatchError), or for different rates (RateError)."""
    if original.provenance.played and not reproduced.provenance.played:
        raise MismatchError(
            "compare: expected the original first and its re-recording second, got a re-recording first; swap the two"
        )
    if original.sensor.shape != reproduced.sensor.shape:
        raise MismatchError(
            f"reproduced: expected the original's {original.sensor.shape} cells, got {reproduced.sensor.shape}"
        )
    if not np.isclose(original.rate, reproduced.rate, rtol=1e-6):
        raise RateError(
            f"reproduced: expected the original's {original.rate:g} Hz, got {reproduced.rate:g} Hz; resample one first"
        )


def _over(part: Array | np.floating | float, whole: Array | np.floating | float) -> Array:
    """Divide two arrays; 0 where the denominator is 0."""
    some, all_of_it = np.asarray(part, float), np.asarray(whole, float)
    return np.divide(some, all_of_it, out=np.zeros_like(all_of_it), where=all_of_it > 0)


def _ratio(part: np.floating, whole: np.floating) -> float:
    return float(part / whole) if whole > 0 else (0.0 if part == 0 else float("inf"))
