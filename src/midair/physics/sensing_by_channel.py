"""Output of a sensor for a pressure of any length, channel by channel; `sensing.sense` does it in memory."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from midair.physics.sensing import SensorModel, channel_response, fade_window, settling_frames

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def channel_volts(
    model: SensorModel, number: int, every: Callable[[int], Array], steps: int, rate: float, *, oversample: int
) -> Array:
    """Output of one channel in V before amplifier, noise and converter, shape (ceil(steps / oversample),), as in
    `sense`.

    The spectrum below half the output rate is the sum of those of every `oversample`-th step with all offsets
    (decimation in time: Cooley and Tukey, Math. Comp. 19 (1965)), so memory grows with the output, not with the
    pressure.

    Parameters
    ----------
    number : int
        Index of the channel.
    every : callable
        Takes the first step; returns every `oversample`-th pressure on the cell from there on, in Pa.
    steps : int
        Total number of steps of pressure.
    rate : float
        Sampling rate of the output, in Hz.
    oversample : int
        Steps of pressure per frame of the output.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    frames, settle = -(-steps // oversample), settling_frames(model, rate)
    length = next_fast_len(frames + 2 * settle, real=True)
    # After the end the last pressure is held and faded out; it belongs to the offset of the last step.
    last, fade = float(every((steps - 1) % oversample)[-1]), fade_window(settle * oversample)
    turn = np.exp(-2j * np.pi * np.arange(length // 2 + 1) / (length * oversample))
    spectrum = np.zeros(length // 2 + 1, np.complex128)
    for phase in reversed(range(oversample)):
        part = np.concatenate([every(phase), last * fade[(phase - steps) % oversample :: oversample]])
        # Horner's scheme in the phase factor of one step.
        spectrum *= turn
        spectrum += rfft(part, length, overwrite_x=True)
    spectrum *= _response(model, number, length, rate) / oversample
    return np.asarray(irfft(spectrum, length, overwrite_x=True)[:frames], np.float64)


def _response(model: SensorModel, number: int, length: int, rate: float) -> Complex:
    """Response of one channel at every bin, shape (bin,)."""
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64)
    row, column = divmod(number, model.grid.columns)
    parts = [
        channel_response(model, frequency[first : first + _BINS])[:, row, column]
        for first in range(0, len(frequency), _BINS)
    ]
    return np.concatenate(parts)


_BINS = 2**13
"""Bins whose responses are computed at once, for all channels."""
