"""How gently the firmware moves phases and intensities, chosen from how far a drive's phases step."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from midair.devices.frame_bytes import TICK, Bytes
from midair.errors import InputError

SilencerChoice = Literal["auto", "off", "quarter", "half", "default"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Silencer:
    """The time over which the firmware spreads a step.

    Attributes
    ----------
    phase, intensity : float
        Time in which a step is complete, in s; 0 is at once.
    reason : str
        Why this was chosen.
    """

    phase: float
    intensity: float
    reason: str

    def __str__(self) -> str:
        spread = "off" if self.phase == 0 else f"phase {1e3 * self.phase:g} ms, intensity {1e3 * self.intensity:g} ms"
        return f"{spread} ({self.reason})"


def typical_step(phases: Bytes, intensity: Bytes) -> float:
    """The phase step from frame to frame that 99 of 100 stay below while sound is on, in degrees; 0 for one frame."""
    on = np.asarray(intensity.reshape(len(intensity), -1).max(axis=1) > 0)
    both = np.flatnonzero(on[1:] & on[:-1])
    if not both.size:
        return 0.0
    # Some five hundred steps tell the percentile of a drive of any length.
    both = both[:: max(1, both.size // 500)]
    # Bytes wrap as phases do: read with a sign, their difference is the short way round.
    step = (phases[both + 1] - phases[both]).view(np.int8).astype(np.int16)
    return float(np.percentile(np.abs(step), 99) * 360 / 256)


def choose_silencer(choice: SilencerChoice, phases: Bytes, intensity: Bytes, rate: float) -> Silencer:
    """What to set for a drive.

    AUTD3's transducer circuit dips to 97, 82 and 16 % of its amplitude after phase steps of 45, 90 and 180 degrees when
    nothing spreads them, and what dips is heard (Suzuki et al., IEEE Trans. Haptics 13(1), 2020). So "auto" takes steps
    up to 45 degrees as they are, spreads larger ones over a quarter of a frame, and those above 90 degrees over half
    of one, so that the second half of each frame is the field that was solved for. "default" is the firmware's own,
    1 ms.

    Raises
    ------
    InputError
        If there is no such choice.
    """
    if choice not in get_args(SilencerChoice):
        raise InputError(f"silencer: expected one of {', '.join(get_args(SilencerChoice))}, got {choice!r}")
    step = typical_step(phases, intensity)
    reason = f"99 % of the phase steps stay below {step:.0f} deg"
    if choice == "default":
        return Silencer(phase=1e-3, intensity=0.25e-3, reason="the firmware's own")
    wanted = ("off" if step <= 45 else "quarter" if step <= 90 else "half") if choice == "auto" else choice
    if wanted == "off":
        return Silencer(phase=0, intensity=0, reason=reason)
    period = (0.25 if wanted == "quarter" else 0.5) / rate
    tick = TICK * 1e-9
    # Whole ticks, from one up to the firmware's own 1 ms.
    spread = max(1, min(round(1e-3 / tick), round(period / tick))) * tick
    return Silencer(phase=spread, intensity=min(spread, 0.25e-3), reason=reason)
