"""Excitation signals for a shaker or a loudspeaker during a calibration: noise and sweeps."""

import numpy as np

from midair.array_types import Array
from midair.dsp import Band, check_band
from midair.errors import InputError
from midair.model import RATE
from midair.validation import positive


def noise_signal(
    rms: float, duration: float, *, rate: float = RATE, band: Band = (5.0, 490.0), rng: np.random.Generator
) -> Array:
    """Generate Gaussian noise with a flat spectrum within a band and zero outside, shape (frame,).

    `rms` has any unit. Bins of 1 Hz need a `duration` of 12 s or more, and longer signals reduce the uncertainty. The
    band (low, high) in Hz is wider than the band to be calibrated.
    """
    low, high = check_band(band, rate)
    frames = _frames(duration, rate)
    spectrum = np.fft.rfft(rng.standard_normal(frames))
    frequency = np.fft.rfftfreq(frames, 1 / rate)
    signal = np.fft.irfft(np.where((frequency >= low) & (frequency <= high), spectrum, 0), frames)
    return positive(rms, "rms") * signal / signal.std()


def sweep_signal(
    rms: float, duration: float, *, rate: float = RATE, band: Band = (10.0, 490.0), silence: float = 0.5
) -> Array:
    """Generate a sine with exponentially rising frequency between two silences, shape (frame,).

    phase = 2 pi f_1 L (e^(t / L) - 1), L = duration / ln(f_2 / f_1) (Farina, AES 108, 2000). The silences separate the
    response of the sensor from the transients at the ends of the recording.

    `rms` is that of the sine, in any unit; `band` is (f_1, f_2) in Hz, f_1 above 0. The first and last twentieth of the
    `duration` in s fade in and out; each `silence` comes in addition.
    """
    low, high = check_band(band, rate)
    if low <= 0:
        raise InputError(f"band of the sweep: expected to begin above 0 Hz, got {low:g} Hz")
    frames = _frames(duration, rate)
    time = np.arange(frames) / rate
    scale = frames / rate / np.log(high / low)
    fade = np.clip(np.minimum(np.arange(frames), np.arange(frames)[::-1]) / max(frames / 20, 1), 0, 1)
    tone = np.sin(2 * np.pi * low * scale * np.expm1(time / scale)) * np.sin(np.pi / 2 * fade) ** 2
    return np.pad(np.sqrt(2) * positive(rms, "rms") * tone, round(silence * rate))


def _frames(duration: float, rate: float) -> int:
    return max(2, round(positive(duration, "duration", "s") * positive(rate, "rate", "Hz")))
