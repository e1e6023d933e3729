"""Exposure profiles in TOML: those of midair and those of users."""

import os
from dataclasses import dataclass
from importlib import resources

import numpy as np

from midair.errors import InputError
from midair.files.text_files import LARGEST_TOML, read_text, toml_of
from midair.files.toml.plain import from_plain
from midair.physics import ExposureProfile, Place

DEFAULT_PROFILE = "occupational-110"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceSheet:
    """Keys of a place with a limit."""

    name: str
    position_mm: tuple[float, float, float]
    reach_mm: float
    limit_db: float
    enforced: bool = True
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileSheet:
    """Keys of a profile."""

    name: str
    title: str
    source: str
    evidence: str
    place: tuple[PlaceSheet, ...]
    duty: float | None = None
    warming_k: float | None = None
    hours: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfilesSheet:
    """Keys of a file of profiles."""

    profile: tuple[ProfileSheet, ...]


def load_profiles(path: str | os.PathLike[str] | None = None) -> dict[str, ExposureProfile]:
    """Exposure profiles of a TOML file, by name; those of midair if None.

    Raises MissingFileError or BrokenFileError if the file does not exist, or is not text; InputError if it contains no
    valid profiles.
    """
    if path is None:
        return profiles_of(resources.files("midair.files.toml").joinpath("exposure.toml").read_text(encoding="utf-8"))
    text = read_text(path, "a TOML file of exposure profiles", largest=LARGEST_TOML)
    try:
        return profiles_of(text)
    except InputError as wrong:
        raise InputError(f"{path}: {wrong}") from wrong


def profile_named(name: str, path: str | os.PathLike[str] | None = None) -> ExposureProfile:
    """One exposure profile; raises InputError if none has that name."""
    profiles = load_profiles(path)
    if name not in profiles:
        raise InputError(f"exposure profile: expected one of {', '.join(profiles)}, got {name!r}")
    return profiles[name]


def profiles_of(text: str) -> dict[str, ExposureProfile]:
    """Exposure profiles of a TOML text, by name, in its order; raises InputError if invalid."""
    try:
        content = toml_of(text)
    except ValueError as wrong:
        raise InputError(f"exposure profiles: expected TOML, got: {wrong}") from wrong
    sheet = from_plain(ProfilesSheet, content, where="exposure profiles: ")
    return {profile.name: profile for profile in map(_profile, sheet.profile)}


def _profile(keys: ProfileSheet) -> ExposureProfile:
    places = tuple(_place(each) for each in keys.place)
    if not any(place.enforced for place in places):
        raise InputError(f"profile {keys.name}: expected at least one enforced limit, got none")
    stated = {"duty": keys.duty, "warming": keys.warming_k, "hours": keys.hours}
    heat = {name: value for name, value in stated.items() if value is not None}
    if not all(0 < limit < np.inf for limit in heat.values()) or heat.get("duty", 1) > 1 or heat.get("hours", 1) > 24:
        raise InputError(
            f"profile {keys.name}: expected duty above 0 and at most 1, warming_k above 0 K, hours above 0, at most 24"
        )
    return ExposureProfile(
        name=keys.name, title=keys.title, source=keys.source, evidence=keys.evidence, places=places, **heat
    )


def _place(keys: PlaceSheet) -> Place:
    if not np.isfinite([*keys.position_mm, keys.reach_mm, keys.limit_db]).all() or keys.reach_mm < 0:
        raise InputError(f"place {keys.name}: expected finite numbers, and reach_mm from 0 on")
    x, y, z = (each * 1e-3 for each in keys.position_mm)
    return Place(
        name=keys.name,
        position=(x, y, z),
        reach=keys.reach_mm * 1e-3,
        limit=keys.limit_db,
        enforced=keys.enforced,
        source=keys.source,
    )
