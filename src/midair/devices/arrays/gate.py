"""Nothing plays on a real array before its exposure has been checked, or a person has answered for it by name."""

import os
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np

from midair.devices.arrays.frame_bytes import amplitude_of
from midair.errors import ExposureError, InputError, MissingFileError
from midair.model import Drive
from midair.physics import Exposure, ExposureProfile, exposure, profiles_of

DEFAULT_PROFILE = "occupational-110"

Outcome = Literal["kept", "attenuated", "overridden", "exceeded"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Admission:
    """A drive that may be played.

    Attributes
    ----------
    drive : Drive
        What to play; weaker than the one that came if it was attenuated.
    exposure : Exposure
        Of the drive that is to be played.
    outcome : {"kept", "attenuated", "overridden", "exceeded"}
        "exceeded" only where no sound can come out.
    by : str
        Who answers for an override.
    """

    drive: Drive
    exposure: Exposure
    outcome: Outcome
    by: str = ""


def load_profiles(path: str | os.PathLike[str] | None = None) -> dict[str, ExposureProfile]:
    """The profiles of a TOML file, by name; those that come with midair if None.

    Raises
    ------
    MissingFileError
        If the file is not there.
    InputError
        If it holds no profiles.
    """
    if path is None:
        return profiles_of(resources.files("midair.physics").joinpath("exposure.toml").read_text(encoding="utf-8"))
    try:
        return profiles_of(Path(path).read_text(encoding="utf-8"))
    except OSError as wrong:
        raise MissingFileError(f"{path}: expected a TOML file of exposure profiles, got {wrong.strerror}") from wrong
    except UnicodeDecodeError as wrong:
        raise InputError(f"{path}: expected a TOML file of exposure profiles, got bytes that are no text") from wrong


def profile_named(name: str, path: str | os.PathLike[str] | None = None) -> ExposureProfile:
    """One profile.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    profiles = load_profiles(path)
    if name not in profiles:
        raise InputError(f"exposure profile: expected one of {', '.join(profiles)}, got {name!r}")
    return profiles[name]


def admit(
    drive: Drive,
    profile: ExposureProfile,
    *,
    repeats: int = 1,
    gated: bool = True,
    attenuate: bool = False,
    override: str | None = None,
) -> Admission:
    """Check a drive against a profile before it is played.

    Parameters
    ----------
    drive : Drive
        To be played.
    profile : ExposureProfile
        That it must keep.
    repeats : int
        How often it is to be played.
    gated : bool
        Whether sound can come out; where it cannot, nothing is refused.
    attenuate : bool
        Whether to weaken a drive that is too strong, all frames alike, until it keeps the profile.
    override : str, optional
        Who answers for playing it all the same.

    Raises
    ------
    ExposureError
        If the drive exceeds the profile and nobody answers for it.
    InputError
        If an override has no name.
    """
    if override is not None and not override.strip():
        raise InputError("--override-exposure: expected the name of the person who answers for it, got none")
    found = exposure(drive, profile, repeats=repeats)
    if found.excess <= 0:
        return Admission(drive=drive, exposure=found, outcome="kept")
    if attenuate:
        weaker = _attenuated(drive, found.excess, profile.name)
        return Admission(drive=weaker, exposure=exposure(weaker, profile, repeats=repeats), outcome="attenuated")
    if override is not None:
        return Admission(drive=drive, exposure=found, outcome="overridden", by=override.strip())
    if not gated:
        return Admission(drive=drive, exposure=found, outcome="exceeded")
    raise ExposureError(
        f"exposure: {found.verdict()}; weaken it with --attenuate ({-found.excess:.1f} dB), take another --profile, or "
        "answer for it with --override-exposure NAME and ear protection for everyone in the room"
    )


def _attenuated(drive: Drive, excess: float, profile: str) -> Drive:
    """The drive at the strongest intensities that a firmware has and that keep the profile."""
    factor = 10 ** (-excess / 20)
    steps = np.arange(256, dtype=np.uint8)
    strength = np.maximum(steps / 255, amplitude_of(steps))
    chosen = np.searchsorted(strength, drive.level * factor, side="right") - 1
    provenance = drive.provenance.then("attenuate", {"factor": factor, "profile": profile})
    return replace(drive, level=np.maximum(chosen, 0) / 255, provenance=provenance)
