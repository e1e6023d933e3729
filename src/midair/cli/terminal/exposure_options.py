"""What may be exposed to what: options that every command has which can sound."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from midair.devices import ExposureChoices, measure
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Drive, Medium, TransducerArray
from midair.physics import ExposureProfile


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureOptions:
    """What a drive may expose people to, on a device that can be heard.

    Parameters
    ----------
    profile
        Of exposure.
    profiles
        TOML file of exposure profiles; those that come with midair if not given.
    attenuate
        Weaken drives until they keep the profile.
    override_exposure
        Name of the person who answers for playing above the profile; it is logged.
    """

    profile: str = DEFAULT_PROFILE
    profiles: Path | None = None
    attenuate: bool = False
    override_exposure: str | None = None

    def choices(self, room: Medium | None = None) -> ExposureChoices:
        """As one value, with the air of the room where a person stated it."""
        return ExposureChoices(
            profile=profile_named(self.profile, self.profiles),
            attenuate=self.attenuate,
            override=self.override_exposure,
            room=room,
        )


def say_how_long(
    drive: Drive,
    profile: ExposureProfile,
    *,
    room: Medium | None = None,
    frames: int | None = None,
    few: float = 3.0,
    sample: int = 1024,
) -> None:
    """Say on the error stream how long the exposure of a drive will take, where that is more than a few seconds.

    Its first frames are timed, the second time, when what is worked out once an array is there already.

    Parameters
    ----------
    room : Medium, optional
        As in `ExposureChoices`.
    frames : int, optional
        How many will be measured; those of the drive if None.
    few : float
        Seconds about which nothing is said.
    sample : int
        Frames that are timed.
    """
    count = drive.frames if frames is None else frames
    if count < 10 * sample:
        return
    level = drive.level[:sample]
    first = replace(drive, phase=drive.phase[:sample], level=level)
    measure(first, drive.array, profile, room=room)
    began = time.perf_counter()
    measure(first, drive.array, profile, room=room)
    lasts = (time.perf_counter() - began) * count / first.frames
    if lasts > few:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"exposure of {count} frames: {lasts:.0f} s")


def say_how_long_to_come(
    frames: int, array: TransducerArray, room: Medium | None, profile: ExposureProfile, *, few: float = 3.0
) -> None:
    """The same of frames that are not there yet, for an array and in the air of a room."""
    phase = np.zeros((1024, array.count))
    some = Drive(phase=phase, level=np.ones(1024), rate=1.0, array=array)
    say_how_long(some, profile, room=room, frames=frames, few=few)
