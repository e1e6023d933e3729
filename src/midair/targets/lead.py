"""Add a lead before and after a recording, so that it starts without a step and a bias has time to rise."""

from dataclasses import replace
from typing import cast

from midair.array_types import Array
from midair.dsp import Band
from midair.errors import InputError
from midair.model import BAND, PressureFrames, Provenance
from midair.streaming import pad_with_fade
from midair.targets.mapping import SlowBias, mapping_of

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
