"""Spectra of vibrations: levels, their difference, the dominant frequency, and the texture.

The texture is spectral shape, balance of bands, and modulation of the envelope; it does not depend on the level. The
balance of high and low frequencies explains most of how noisy vibrations differ once their intensity is equalised
(Bernard, Thoret, Huloux and Ystad, The high/low frequency balance drives the perception of noisy vibrations, 2023).
"""

import numpy as np

from midair.array_types import Array
from midair.dsp import band_energies
from midair.model import BAND


def level(power: Array, reference: Array | float = 1.0) -> Array:
    """10 log10(power / reference) in dB, same shape: infinite or NaN for silence."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(10 * np.log10(power / reference), np.float64)


def spectral_error(original: Array, later: Array) -> float:
    """Rms level difference of two power densities (bin, ...) in dB, weighted by the power of the original.

    Bins with little power in the original have little weight, so that noise floors do not matter. The result is never
    NaN: for a silent original it is 0 if the other is silent too, otherwise infinite.
    """
    total = original.sum()
    if total <= 0:
        return 0.0 if later.sum() <= 0 else float("inf")
    # Silence has no level, so use 120 dB below the strongest bin instead.
    tiny = 1e-12 * original.max()
    difference = 10 * np.log10((later + tiny) / (original + tiny))
    return float(np.sqrt((original * difference**2).sum() / total))


def dominant_frequency(samples: Array, rate: float) -> float:
    """Frequency in Hz of the strongest Fourier component of samples (frame, ...), all channels together."""
    power = np.zeros(len(samples) // 2 + 1)
    for channel in samples.reshape(len(samples), -1).T:
        power += np.abs(np.fft.rfft(channel - channel.mean())) ** 2
    return float(np.fft.rfftfreq(len(samples), 1 / rate)[int(np.argmax(power))])


THIRD_OCTAVES = tuple(float(1000 * 10 ** (number / 10)) for number in range(-16, -3))
"""Centre frequencies of the third octaves completely within 20 to 470 Hz, 25 to 398 Hz (base ten, IEC 61260-1)."""

OCTAVE_BANDS = tuple((middle / 10**0.05, middle * 10**0.05) for middle in THIRD_OCTAVES)
"""Ends of the third octaves in Hz."""

SPLIT = 100.0
"""Frequency in Hz between the low and the high band of the balance, near the middle of the band in octaves."""

MODULATION = ((2.0, 8.0), (8.0, 32.0), (32.0, 128.0))
"""Bands in Hz of the envelope's spectrum."""

_SLOPE, _BALANCE = "spectral slope", f"balance above over below {SPLIT:g} Hz"
_ENVELOPE = [f"envelope, {low:g} to {high:g} Hz" for low, high in MODULATION]
TEXTURE = {
    _SLOPE: ("", "s of a power density f^-s: 0 for white noise, more for weaker high frequencies."),
    _BALANCE: ("dB", "Power of high over that of low frequencies: the strongest cue between noisy textures."),
    **dict.fromkeys(_ENVELOPE, ("dB", "Swings of the vibration's envelope relative to its mean: its rhythm.")),
}
"""Unit and meaning of each figure of `texture`; none depends on the level."""


def texture(pressure: Array, rate: float) -> dict[str, Array]:
    """Figures of `TEXTURE` for each channel of pressure, shape (frame, ...), and last for all channels together.

    The slope is the least-squares line through the levels of the third octaves, where the power of f^-s is
    proportional to f^(1 - s). The envelope is the magnitude of the analytic signal in 20 to 470 Hz; a band of its
    spectrum needs two periods. Undefined figures are NaN or infinite.
    """
    x = pressure.reshape(len(pressure), -1)

    centred = np.log10(THIRD_OCTAVES) - np.mean(np.log10(THIRD_OCTAVES))
    low, high = BAND[0], min(BAND[1], rate / 2)
    *octave, above, below = band_energies(x, rate, [*OCTAVE_BANDS, (SPLIT, high), (low, SPLIT)])
    octaves = np.array([level(_with_all(each)) for each in octave])
    with np.errstate(invalid="ignore"):
        slope = 1 - centred @ octaves / 10 / (centred @ centred)
    envelope = _envelope(x, rate, (low, high))
    mean = envelope.mean(axis=0)
    spectrum = np.abs(np.fft.rfft(envelope - mean, axis=0)) ** 2 * 2 / len(x) ** 2
    at = np.fft.rfftfreq(len(x), 1 / rate)
    found = {_SLOPE: slope, _BALANCE: level(_with_all(above), _with_all(below))}
    for name, (first, last) in zip(_ENVELOPE, MODULATION, strict=True):
        swings = level(_with_all(spectrum[(at >= first) & (at < last)].sum(axis=0)), _with_all(mean**2))
        found[name] = swings if first * len(x) / rate >= 2 else np.full_like(swings, np.nan)
    return found


def _with_all(power: Array) -> Array:
    return np.append(power, power.sum())


def _envelope(x: Array, rate: float, band: tuple[float, float]) -> Array:
    """Magnitude of the analytic signal of x, shape (frame, channel), within a band."""
    at = np.fft.fftfreq(len(x), 1 / rate)[:, None]
    inside = (at >= band[0]) & (at <= band[1])
    return np.asarray(np.abs(np.fft.ifft(np.where(inside, 2 * np.fft.fft(x, axis=0), 0), axis=0)), np.float64)
