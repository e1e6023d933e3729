"""Louder beforehand what the playing of frames makes quieter.

Holding a frame and the envelope of a transducer both act on the amplitude of the sound, and so `precompensate_sound`
undoes them there, at all frequencies: exactly so where the phase of the field stays as it is. `precompensate` undoes
them on pressure, within the band that is wanted: exactly so for changes that are small against the pressure.
"""

from dataclasses import replace

import numpy as np

from midair.dsp import band_window, filter_response
from midair.lazy_frames import each_frame
from midair.model import AmplitudeFrames, PressureFrames, Setting
from midair.physics import TransducerDynamics, playback_response

Band = tuple[float, float]


def precompensate(
    pressure: PressureFrames,
    *,
    dynamics: TransducerDynamics | None = None,
    ramp: float = 0.0,
    band: Band = (20.0, 480.0),
) -> PressureFrames:
    """Pressure with the inverse of what holding frames and the transducers' envelope do to it.

    W(f) = 1 / [sinc(f / R) sinc(f T) H(f)] within the band and 1 outside, with R the frame rate, T the ramp and H the
    envelope (`physics.playback_response`). Delays are undone as well, so that what is played is not late. Do this
    before a mapping: what it adds below zero the mapping lifts or cuts.

    Parameters
    ----------
    pressure : PressureFrames
        What is wanted, at the rate of the frames that are to be played.
    dynamics : TransducerDynamics, optional
        Dynamics of the transducers; the usual ones if None.
    ramp : float
        Over how long a silencer spreads each step, in s; 1 / rate makes ramps of steps.
    band : tuple of float
        (low, high) of what is compensated in full, in Hz; half cosines lead down to 0 and up to 1.05 high.

    Returns
    -------
    PressureFrames
        Same rate and number of frames.
    """
    dynamics, (low, high) = dynamics or TransducerDynamics(), band

    def inverse(frequency: np.ndarray) -> np.ndarray:
        inside = band_window(frequency, (low / 2, 1.025 * high), edges=(low, high / 20))
        # The window is .5 at its corners: these put the whole band into its flat part.
        response = playback_response(frequency, pressure.rate, dynamics=dynamics, ramp=ramp)
        return (1 + inside * (1 / np.where(inside > 0, response, 1) - 1)).reshape(-1, 1, 1)

    return replace(
        pressure,
        # Four periods of the lower edge, which is `low` wide and reaches furthest.
        pressure=filter_response(pressure.pressure, pressure.rate, inverse, reach=4 / low),
        provenance=pressure.provenance.then("precompensate", _settings(dynamics, ramp) | {"band_hz": band}),
    )


def precompensate_sound(
    target: AmplitudeFrames, *, dynamics: TransducerDynamics | None = None, ramp: float = 0.0, reach: float = 0.1
) -> AmplitudeFrames:
    """Sound amplitude with the inverse of what holding frames and the transducers' envelope do to it.

    1 / [sinc(f / R) sinc(f T) H(f)] up to half the frame rate. Where a target rises and falls again faster than the
    transducers can follow, what was to be below zero is 0.

    Parameters
    ----------
    target : AmplitudeFrames
        What is wanted, at the rate of the frames that are to be played.
    dynamics, ramp
        As in `precompensate`.
    reach : float
        Over how long the inverse is taken to act, in s.

    Returns
    -------
    AmplitudeFrames
        Same rate, points and number of frames.
    """
    dynamics = dynamics or TransducerDynamics()

    def inverse(frequency: np.ndarray) -> np.ndarray:
        return 1 / playback_response(frequency, target.rate, dynamics=dynamics, ramp=ramp)[:, None]

    louder = filter_response(target.amplitude, target.rate, inverse, reach=reach)
    return replace(
        target,
        amplitude=each_frame(louder, lambda block: np.maximum(block, 0.0)),
        provenance=target.provenance.then("precompensate sound", _settings(dynamics, ramp)),
    )


def _settings(dynamics: TransducerDynamics, ramp: float) -> dict[str, Setting]:
    return {"ramp_s": ramp, "time_constant_s": dynamics.time_constant, "detuning_rad_s": dynamics.detuning}
