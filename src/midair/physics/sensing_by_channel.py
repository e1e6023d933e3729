"""What a sensor puts out under a pressure of any length, channel after channel, as `sensing.sense` does in memory."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from midair.physics.sensing import SensorModel, channel_response, fade_window, settling_frames

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def channel_volts(
    model: SensorModel, number: int, every: Callable[[int], Array], steps: int, rate: float, *, oversample: int
) -> Array:
    """Output of one channel before amplifier, noise and converter: that of `sense`, to rounding.

    The spectrum below half the output's rate is summed up from those of every `oversample`-th step, each begun one step
    later than the one before (decimation in time: Cooley and Tukey, Math. Comp. 19 (1965)). So what is in memory is as
    long as the output, not as the pressure.

    Parameters
    ----------
    model : SensorModel
        The sensor.
    number : int
        Of the channel.
    every : callable
        Takes the first step; gives from there on every `oversample`-th pressure that the cell feels, in Pa.
    steps : int
        How many steps of pressure there are.
    rate : float
        Of the output, in Hz.
    oversample : int
        Steps of pressure for one frame of the output.

    Returns
    -------
    ndarray, shape (ceil(steps / oversample),)
        In V.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    frames, settle = -(-steps // oversample), settling_frames(model, rate)
    length = next_fast_len(frames + 2 * settle, real=True)
    # The last pressure, held and fading after the end; it lies in the phase of the last step.
    last, fade = float(every((steps - 1) % oversample)[-1]), fade_window(settle * oversample)
    turn = np.exp(-2j * np.pi * np.arange(length // 2 + 1) / (length * oversample))
    spectrum = np.zeros(length // 2 + 1, np.complex128)
    for phase in reversed(range(oversample)):
        part = np.concatenate([every(phase), last * fade[(phase - steps) % oversample :: oversample]])
        # Horner's scheme in the turn by one step.
        spectrum *= turn
        spectrum += rfft(part, length, overwrite_x=True)
    spectrum *= _response(model, number, length, rate) / oversample
    return np.asarray(irfft(spectrum, length, overwrite_x=True)[:frames], np.float64)


def _response(model: SensorModel, number: int, length: int, rate: float) -> Complex:
    """Of one channel at every bin, shape (bin,)."""
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64)
    row, column = divmod(number, model.grid.columns)
    parts = [
        channel_response(model, frequency[first : first + _BINS])[:, row, column]
        for first in range(0, len(frequency), _BINS)
    ]
    return np.concatenate(parts)


_BINS = 2**13
"""Bins whose responses are worked out together, of all channels."""
