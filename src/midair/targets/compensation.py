"""Before a target is played: compensate the low-pass effect of frames and transducers, and add a lead.

Holding a frame and the envelope of a transducer both act on the amplitude of the sound. `precompensate_sound` inverts
them there, at all frequencies: exact if the phase of the field is constant. `precompensate` inverts them on pressure,
within a band: exact for small relative changes of the pressure. A lead before and after a recording lets it start
without a step, and gives a bias time to rise.
"""

from dataclasses import replace
from typing import cast

import numpy as np

from midair.array_types import Array
from midair.dsp import Band, band_window, filter_response
from midair.errors import InputError
from midair.model import BAND, AmplitudeFrames, PressureFrames, Provenance, Setting
from midair.physics import TransducerDynamics, playback_response
from midair.streaming import each_frame, pad_with_fade
from midair.targets.mapping import SlowBias, mapping_of


def precompensate(
    pressure: PressureFrames,
    *,
    dynamics: TransducerDynamics | None = None,
    ramp: float = 0.0,
    band: Band = (20.0, 480.0),
) -> PressureFrames:
    """Pressure filtered by the inverse of the hold of frames and the transducers' envelope.

    W(f) = 1 / [sinc(f / R) sinc(f T) H(f)] within the band and 1 outside, with R the frame rate, T the ramp and H the
    envelope (`physics.playback_response`). Delays are compensated, too. Apply it before a mapping, which handles the
    negative values that it adds.

    The pressure has the frame rate of playback, and the `dynamics` are the default ones if None. `ramp` is the time
    over which a silencer spreads each step, in s; 1 / rate gives linear interpolation. `band` is (low, high) of full
    compensation, in Hz, with cosine transitions from 0 to low and from high to 1.05 high.
    """
    dynamics, (low, high) = dynamics or TransducerDynamics(), band

    def inverse(frequency: np.ndarray) -> np.ndarray:
        inside = band_window(frequency, (low / 2, 1.025 * high), edges=(low, high / 20))
        # The window is .5 at its corners; these corners put the whole band into its flat part.
        response = playback_response(frequency, pressure.rate, dynamics=dynamics, ramp=ramp)
        return (1 + inside * (1 / np.where(inside > 0, response, 1) - 1)).reshape(-1, 1, 1)

    return replace(
        pressure,
        # Four periods of the lower transition, which is `low` wide and has the longest impulse response.
        pressure=filter_response(pressure.pressure, pressure.rate, inverse, reach=4 / low),
        provenance=pressure.provenance.then("precompensate", _settings(dynamics, ramp) | {"band_hz": band}),
    )


def precompensate_sound(
    target: AmplitudeFrames, *, dynamics: TransducerDynamics | None = None, ramp: float = 0.0, reach: float = 0.1
) -> AmplitudeFrames:
    """Sound amplitude filtered by the inverse of the hold of frames and the transducers' envelope.

    1 / [sinc(f / R) sinc(f T) H(f)] up to half the frame rate, which is that of playback. Negative results, where a
    target changes faster than the transducers can follow, are set to 0. `dynamics` and `ramp` are as in
    `precompensate`; `reach` is half the length of the filter's impulse response, in s.
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


LONGEST = 10.0
"""Longest lead, in s."""


def default_lead(mapping: str, band: Band) -> float:
    """Lead in s that a mapping needs in a band: the fade, and before it the rise time of a bias.

    For 20 Hz 60 ms, and 150 ms with a slow bias.
    """
    chosen = mapping_of(mapping, band)
    return _swell(band) + (chosen.seconds if isinstance(chosen, SlowBias) else 0.0)


def add_lead(pressure: PressureFrames, lead: float) -> PressureFrames:
    """Add `lead` seconds on both sides: silence, then a fade to the first frame. Lazy frames stay lazy.

    Raises InputError if the lead is below 0 or not below 10 s.
    """
    if not 0 <= lead < LONGEST:
        raise InputError(f"lead: expected 0 to {LONGEST:g} s, got {lead:g} s")
    pad = round(lead * pressure.rate)
    if not pad:
        return pressure
    provenance = pressure.provenance.then("lead", {"lead_s": pad / pressure.rate})
    swell = round(_swell(pressure.band or BAND) * pressure.rate)
    return replace(
        pressure, pressure=cast("Array", pad_with_fade(pressure.pressure, pad, swell)), provenance=provenance
    )


def remove_lead(pressure: PressureFrames, frames: int) -> PressureFrames:
    """The middle `frames`, without the lead."""
    first = (pressure.frames - frames) // 2
    return pressure if first <= 0 else replace(pressure, pressure=pressure.pressure[first : first + frames])


def frames_without_lead(provenance: Provenance, frames: int, rate: float) -> slice:
    """The frames without the lead, from the provenance of data made from a pressure."""
    seconds = provenance.last("lead").get("lead_s")
    pad = round(float(seconds) * rate) if isinstance(seconds, int | float) else 0
    return slice(pad, frames - pad) if 2 * pad < frames else slice(0, frames)


def _swell(band: Band) -> float:
    """Length of the fade in s, 1.2 periods of the lower corner: a half wave below half the corner is hardly in the
    band.
    """
    return 1.2 / max(band[0], 1.0)
