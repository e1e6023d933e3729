"""Exposure options of all commands that can play, and the time estimate of the exposure check."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from midair.devices import ExposureChoices, measure_exposure
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Drive, Medium, TransducerArray
from midair.physics import ExposureProfile


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureOptions:
    """Exposure limits for a real array or its emulator.

    Parameters
    ----------
    profile
        Name of the exposure profile.
    profiles
        TOML file of exposure profiles. [default: the profiles of midair]
    attenuate
        Reduce the level of drives that exceed the profile until they meet it.
    override_exposure
        Play above the profile; give the name of the responsible person, which is logged.
    """

    profile: str = DEFAULT_PROFILE
    profiles: Path | None = None
    attenuate: bool = False
    override_exposure: str | None = None

    def choices(self, room: Medium | None = None) -> ExposureChoices:
        """The options as one value, with the stated air of the room."""
        return ExposureChoices(
            profile=profile_named(self.profile, self.profiles),
            attenuate=self.attenuate,
            override=self.override_exposure,
            room=room,
        )


def print_check_time(
    drive: Drive,
    profile: ExposureProfile,
    *,
    room: Medium | None = None,
    frames: int | None = None,
    few: float = 3.0,
    sample: int = 1024,
) -> None:
    """Print the time of the exposure check of a drive if it is above `few` seconds; `sample` frames are timed twice."""
    count = drive.frames if frames is None else frames
    if count < 10 * sample:
        return
    level = drive.level[:sample]
    first = replace(drive, phase=drive.phase[:sample], level=level)
    measure_exposure(first, drive.array, profile, room=room)
    began = time.perf_counter()
    measure_exposure(first, drive.array, profile, room=room)
    lasts = (time.perf_counter() - began) * count / first.frames
    if lasts > few:
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"exposure of {count} frames: {lasts:.0f} s")


def print_check_time_ahead(
    frames: int, array: TransducerArray, room: Medium | None, profile: ExposureProfile, *, few: float = 3.0
) -> None:
    """The same estimate for frames that are not solved yet."""
    phase = np.zeros((1024, array.count))
    some = Drive(phase=phase, level=np.ones(1024), rate=1.0, array=array)
    print_check_time(some, profile, room=room, frames=frames, few=few)
