"""Fidelity of a delivered pressure: signal to distortion in the band, images above it, and spatial correlation.

Before a comparison the delay is found and removed, and the re-recording of a perfect reproduction is computed.

An original has passed the soft edges of the band once, during calibration. Its reproduction is recorded and calibrated
again, so it passes them twice: at a corner, where half of the original's amplitude is left, a perfect reproduction has
a quarter. A comparison with the original itself would count this as an error.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.dsp import Band, band_edges, band_energy, band_window, fast_length, filter_response, resample
from midair.errors import MismatchError
from midair.model import BAND, PressureFrames
from midair.streaming import block_ranges


def find_delay(original: Array, later: Array, rate: float, *, longest: float = 0.05) -> float:
    """Delay of `later` after `original` in s, from the peak of the cross-correlation summed over the channels.

    The peak is located between samples by band-limited interpolation. The delay is 0 if either signal is silent. Both
    signals, shape (frame, ...), have the same channels and `rate` in Hz; `longest` is the largest delay in either
    direction, in s, and at most the length of the signals.
    """
    reach = max(1, min(round(longest * rate), max(len(original), len(later)) - 1))
    around = _correlation(original, later, reach)
    best = int(np.argmax(around))
    # Without positive correlation at any delay, a shift would be arbitrary.
    if around[best] <= 0:
        return 0.0
    if not 0 < best < 2 * reach:
        return (best - reach) / rate
    return (best - reach + _subframe_offset(around, best)) / rate


def _subframe_offset(around: Array, best: int) -> float:
    """Distance from the largest value to the interpolated peak in frames, between -1 and 1.

    A parabola through three values misses the peak of dense noise by up to .07 of a frame. The correlation has no
    components above half the rate, so a sinc with a Hann window interpolates it.
    """
    places = np.arange(max(0, best - _SINC), min(len(around), best + _SINC + 1))
    fine = np.arange(-_FINE, _FINE + 1) / _FINE
    away = best + fine[:, None] - places
    window = np.cos(np.pi / 2 * np.clip(away / (_SINC + 1), -1, 1)) ** 2
    curve = (np.sinc(away) * window) @ around[places]
    peak = int(np.argmax(curve[1:-1])) + 1
    left, middle, right = curve[peak - 1 : peak + 2]
    bend = left - 2 * middle + right
    # Refine only a peak with negative curvature; a flat one has no defined position.
    return float(fine[peak] + (0.5 * (left - right) / bend / _FINE if bend < 0 else 0.0))


_SINC, _FINE = 16, 50
"""Values on each side for the interpolation, and its steps per frame."""


def _correlation(original: Array, later: Array, reach: int) -> Array:
    """Cross-correlation for lags of -reach to reach frames, shape (2 reach + 1,), block by block."""
    total = np.zeros(2 * reach + 1)
    for first, last in block_ranges(original.shape):
        a = original[first:last].reshape(last - first, -1)
        # Pad with zeros, so that no lag wraps around.
        b = np.zeros((len(a) + 2 * reach, a.shape[1]))
        begin, end = max(0, first - reach), max(0, min(len(later), last + reach))
        if begin < end:
            at = begin - first + reach
            b[at : at + end - begin] = later[begin:end].reshape(end - begin, -1)
        length = fast_length(len(b))
        both = np.conj(np.fft.rfft(a, length, axis=0)) * np.fft.rfft(b, length, axis=0)
        total += np.fft.irfft(both.sum(axis=1), length)[: 2 * reach + 1]
    return total


def advance(samples: Array, delay: float, rate: float) -> Array:
    """Shift `samples` earlier by `delay` seconds, with silence on both sides, by a linear phase on the spectrum.

    The delay may have any sign, also fractions of a frame. `samples` have the shape (frame, ...) and a `rate` in Hz.
    """
    length = 2 * len(samples)
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(length, 1 / rate) * delay)
    moved = np.empty((len(samples), int(np.prod(samples.shape[1:], dtype=np.int64))))
    # One channel at a time, because the spectrum of all channels takes four times their memory.
    for channel, values in enumerate(samples.reshape(moved.shape).T):
        moved[:, channel] = np.fft.irfft(np.fft.rfft(values, length) * turn, length)[: len(samples)]
    return moved.reshape(samples.shape)


def apply_band_twice(asked: PressureFrames) -> PressureFrames:
    """Filter a pressure with its own band again, as the re-recording of a perfect reproduction.

    Silence is assumed before and after. A pressure without a band is returned unchanged.
    """
    band = asked.band
    if band is None:
        return asked
    edges = _edges(asked)

    def window(frequency: Array) -> Array:
        return band_window(frequency, band, edges=edges).reshape(-1, 1, 1)

    rest = band_settling_frames(band, asked.rate)
    longer = np.pad(asked.pressure, ((rest, rest), (0, 0), (0, 0)))
    heard = filter_response(longer, asked.rate, window, reach=rest / asked.rate)
    return replace(asked, pressure=heard[rest : rest + asked.frames])


def band_settling_frames(band: tuple[float, float], rate: float) -> int:
    """Number of silent frames after which a band's filter has decayed: four periods of the lower corner."""
    return int(np.ceil(4 * rate / max(band[0], 1.0)))


def _edges(asked: PressureFrames) -> tuple[float, float]:
    """Edges of the band in the calibration step of the provenance, or the default edges."""
    edges = asked.provenance.last("calibrate").get("edges_hz")
    if isinstance(edges, tuple) and len(edges) == 2:
        rise, fall = (float(width) for width in edges if isinstance(width, int | float))
        return rise, fall
    return band_edges(asked.band or (0.0, asked.rate / 2), asked.rate)


WEAKEST = 20.0
"""Cells count as targets down to this many dB below the strongest cell."""

IMAGES = (530.0, 1000.0)
"""Band in Hz in which frame steps create images of the signal band."""

Limits = tuple[float, float, float]
"""A ratio in dB, and its lower and upper limit: those of 95 % for the scatter of the sensor's noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fidelity:
    """Fidelity of a delivered pressure."""

    distortion_ratio: float
    """Signal-to-distortion ratio in dB over the cells with a target, with the best gain for each cell."""
    overall_ratio: float
    """The same ratio with one gain and over all cells, so that pressure beside the target counts as distortion."""
    images: float | None
    """Power in the band of the images over that in the band, in dB; None if the rate is too low."""
    spatial_correlation: float
    """Correlation over the cells of the maps of rms pressure in the band, -1 to 1."""
    gain: float
    """Best gain over all cells."""
    delay: float
    """In s."""
    ratios: Mapping[str, Limits]
    """Each signal-to-distortion ratio by its name, see `RATIOS`; without noise only where that is known."""


TOUCHED, OVERALL = "signal to distortion, touched cells", "signal to distortion"
"""Names of the two ratios in every output."""
RATIOS = {
    TOUCHED: "level differences between cells are removed; noise counts",
    f"{TOUCHED}, without noise": "the array alone: the known noise of the sensor is removed too",
    OVERALL: "one gain for all cells: level differences, noise and pressure on untouched cells count",
    f"{OVERALL}, without noise": "the same without the known noise of the sensor",
}
"""Each ratio in one line, by its name."""


def ratio_text(limits: Limits) -> str:
    """A ratio in dB with its limits, where it has any, as text."""
    ratio, low, high = limits
    if low == high:
        return f"{ratio:.1f}"
    if np.isinf(ratio):
        return f"above {low:.1f}"
    return f"{ratio:.1f} ({low:.1f} {'or more' if np.isinf(high) else f'to {high:.1f}'})"


def distortion_ratios(
    power: Array, own: Array, gain: float, apart: Array, *, noise: Array | None, frames: int, values: float
) -> dict[str, Limits]:
    """Each ratio of `RATIOS` with its limits; those without noise only if `noise` is given.

    `power` is the energy of the original in each channel, `apart` that of the residual after the channel's own gain
    `own`; `gain` is the best one over all channels. `noise` is the rms of each channel over the `frames`, with `values`
    independent values: twice its bandwidth times the duration.
    """
    touched = (power > 0) & (power >= power.max() * 10 ** (-WEAKEST / 10))
    # Residual of each channel after its own gain, plus the deviation of that gain from the common one.
    parts = {
        TOUCHED: (float((own**2 * power)[touched].sum()), apart[touched], touched),
        OVERALL: (gain**2 * float(power.sum()), apart + (own - gain) ** 2 * power, np.ones_like(touched)),
    }
    found: dict[str, Limits] = {}
    for name, (signal, rest, cells) in parts.items():
        ratio = decibels(signal, float(rest.sum()))
        found[name] = (ratio, ratio, ratio)
        if noise is not None:
            found[f"{name}, without noise"] = _without_noise(signal, rest, frames * noise.ravel()[cells] ** 2, values)
    return found


def _without_noise(signal: float, rest: Array, noise: Array, values: float) -> Limits:
    """Ratio and its limits from the energies of residuals and of independent Gaussian noise in them.

    The sum of n squares of d + e, e of variance s^2, has the mean D + N and the variance (4 D N + 2 N^2) / n, with
    D the sum of d^2 and N = n s^2.
    """
    left = float((rest - noise).sum())
    scatter = 4 * np.maximum(rest - noise, 0) * noise + 2 * noise**2
    error = 1.96 * float(np.sqrt(scatter.sum() / values))
    middle = max(left, 0.0)
    return decibels(signal, middle), decibels(signal, middle + error), decibels(signal, max(left - error, 0.0))


def fidelity(
    original: PressureFrames,
    delivered: PressureFrames,
    *,
    band: Band = BAND,
    judged: tuple[float, float] | None = None,
    noise: Array | None = None,
) -> Fidelity:
    """Compare the delivered pressure with its original.

    Both pressures are on the same cells; the slower one is resampled to the rate of the faster one, and both are
    filtered to the `band` (low, high) in Hz with sharp edges. `judged` is (begin, duration) of the evaluated part, in s
    of the original; all if None. It is cut after filtering and alignment: a perfect piece with a delay of an eighth of
    a millisecond would otherwise lose samples at its ends and reach only 25 to 45 dB. `noise`, shape (row, column), is
    the rms noise of the sensor in the delivered pressure, in the band, in Pa. Raises MismatchError if the cells differ.
    """
    if original.sensor.shape != delivered.sensor.shape:
        raise MismatchError(
            f"delivered: expected the original's {original.sensor.shape} cells, got {delivered.sensor.shape}"
        )
    rate = max(original.rate, delivered.rate)
    x, y = (resample(each.pressure, each.rate, rate) for each in (original, delivered))
    frames = min(len(x), len(y))
    x, y = in_band(x[:frames], rate, band), in_band(y[:frames], rate, band)
    delay = find_delay(x, y, rate)
    # Align before fitting a gain, because a delay is no distortion.
    y = advance(y, delay, rate)
    begin, duration = judged or (0.0, frames / rate)
    part = slice(round(begin * rate), round(begin * rate) + round(duration * rate))
    x, y = x[part], y[part]
    power, product = ((x * each).sum(axis=0).ravel() for each in (x, y))
    own = np.divide(product, power, out=np.zeros_like(power), where=power > 0)
    gain = float(product.sum() / max(float(power.sum()), np.finfo(float).tiny))
    apart = ((y - own.reshape(x.shape[1:]) * x) ** 2).sum(axis=0).ravel()
    values = 2 * (band[1] - band[0]) * len(x) / rate
    found = distortion_ratios(power, own, gain, apart, noise=noise, frames=len(x), values=values)
    return Fidelity(
        distortion_ratio=found[TOUCHED][0],
        overall_ratio=found[OVERALL][0],
        ratios=found,
        images=image_level(delivered.cut(begin, duration) if judged else delivered, band=band),
        spatial_correlation=map_correlation(x, y),
        gain=gain,
        delay=delay,
    )


def in_band(pressure: Array, rate: float, band: Band) -> Array:
    """Filter pressure, shape (frame, ...), to a band with sharp edges and without delay."""
    inside, axes = (band[0], min(band[1], rate / 2)), [1] * (pressure.ndim - 1)
    return filter_response(
        pressure, rate, lambda f: band_window(f, inside, edges=(0.0, 0.0)).reshape(-1, *axes), reach=0.1
    )


def image_level(delivered: PressureFrames, *, band: Band = BAND) -> float | None:
    """Power in the band of the images over that in the band, over all cells, in dB; None if the rate is too low."""
    if delivered.rate < 2 * IMAGES[1]:
        return None
    above, within = (float(band_energy(delivered.pressure, delivered.rate, each).sum()) for each in (IMAGES, band))
    return decibels(above, within)


def map_correlation(x: Array, y: Array) -> float:
    """Correlation of the maps of rms pressure over the cells; 0 if a map is uniform."""
    a, b = (np.sqrt((each**2).mean(axis=0)).ravel() for each in (x, y))
    a, b = a - a.mean(), b - b.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


def finite(value: float | None) -> float | None:
    """Return `value`, or None if it is infinite or NaN, which JSON cannot represent."""
    return value if value is not None and np.isfinite(value) else None


def decibels(signal: float, rest: float) -> float:
    """10 log10(signal / rest); infinite at the limits, never NaN."""
    if signal <= 0:
        return float("-inf")
    return float(10 * np.log10(signal / rest)) if rest > 0 else float("inf")
