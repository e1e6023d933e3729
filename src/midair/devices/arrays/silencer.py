"""Settings of the firmware's silencer, which smooths steps of phases and intensities."""

from dataclasses import dataclass
from typing import Literal, get_args

from midair.devices.frame_bytes import TICK
from midair.errors import InputError

SilencerChoice = Literal["off", "quarter", "half", "default"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Silencer:
    """Time constants of the firmware's silencer."""

    phase: float
    """Time in which a step of the phase is complete, in s; 0 is off."""
    intensity: float
    """Time in which a step of the intensity is complete, in s; 0 is off."""

    def __str__(self) -> str:
        return "off" if self.phase == 0 else f"phase {1e3 * self.phase:g} ms, intensity {1e3 * self.intensity:g} ms"


def silencer_named(choice: str, rate: float) -> Silencer:
    """The silencer of a name for a frame rate in Hz: off, a quarter or half of a frame, or the firmware's own 1 ms.

    Raises InputError if the name is unknown.
    """
    if choice not in get_args(SilencerChoice):
        raise InputError(f"silencer: expected one of {', '.join(get_args(SilencerChoice))}, got {choice!r}")
    if choice == "off":
        return Silencer(phase=0, intensity=0)
    if choice == "default":
        return Silencer(phase=1e-3, intensity=0.25e-3)
    period, tick = (0.25 if choice == "quarter" else 0.5) / rate, TICK * 1e-9
    # Whole ticks, from one up to the firmware's own 1 ms.
    spread = max(1, min(round(1e-3 / tick), round(period / tick))) * tick
    return Silencer(phase=spread, intensity=min(spread, 0.25e-3))
