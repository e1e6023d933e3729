"""Exposure profiles in TOML: those of midair and those of users."""

import os
from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.files.text_files import LARGEST_TOML, read_text, toml_of
from midair.physics import ExposureProfile, Place

DEFAULT_PROFILE = "occupational-110"


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
    try:
        profiles = [_profile(each) for each in content["profile"]]
    except KeyError as wrong:
        raise InputError(
            f"exposure profiles: expected the key {wrong}; copy a profile of midair and change it"
        ) from wrong
    except (TypeError, ValueError, AttributeError) as wrong:
        raise InputError(f"exposure profiles: {wrong}; copy a profile of midair and change it") from wrong
    return {profile.name: profile for profile in profiles}


def _profile(entry: Mapping[str, Any]) -> ExposureProfile:
    _check_keys(entry, {"name", "title", "source", "evidence", "place", "duty", "warming_k"})
    places = tuple(_place(each) for each in entry["place"])
    if not any(place.enforced for place in places):
        raise InputError(f"profile {entry['name']}: expected at least one enforced limit, got none")
    heat = {key.removesuffix("_k"): float(entry[key]) for key in ("duty", "warming_k") if key in entry}
    if not all(0 < limit < np.inf for limit in heat.values()) or heat.get("duty", 1) > 1:
        raise InputError(f"profile {entry['name']}: expected a duty above 0 and at most 1, and warming_k above 0 K")
    return ExposureProfile(
        name=str(entry["name"]),
        title=str(entry["title"]),
        source=str(entry["source"]),
        evidence=str(entry["evidence"]),
        places=places,
        **heat,
    )


def _place(entry: Mapping[str, Any]) -> Place:
    _check_keys(entry, {"name", "position_mm", "reach_mm", "limit_db", "enforced", "source"})
    x, y, z = (float(each) * 1e-3 for each in entry["position_mm"])
    numbers = np.array([x, y, z, entry["reach_mm"], entry["limit_db"]], float)
    enforced = entry.get("enforced", True)
    if not np.isfinite(numbers).all() or numbers[3] < 0 or not isinstance(enforced, bool):
        raise InputError(f"place {entry['name']}: expected finite numbers, reach_mm from 0 on, enforced true or false")
    return Place(
        name=str(entry["name"]),
        position=(x, y, z),
        reach=float(entry["reach_mm"]) * 1e-3,
        limit=float(entry["limit_db"]),
        enforced=enforced,
        source=str(entry.get("source", "")),
    )


def _check_keys(entry: Mapping[str, Any], known: set[str]) -> None:
    if unknown := set(entry) - known:
        raise InputError(f"expected {', '.join(sorted(known))}, got {', '.join(sorted(unknown))}")
