"""Uncertainties of a laboratory in TOML, ``lab.toml``, for the part "palm and laboratory" of an error budget."""

import os
from dataclasses import dataclass, fields
from pathlib import Path

from midair.errors import BrokenFileError, InputError
from midair.files.atomic import atomic_file
from midair.files.text_files import read_toml
from midair.files.toml.plain import from_plain
from midair.validation import Declared, check_settings, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory(Declared):
    """Standard uncertainties (k = 1), for the palm and the units along each axis; InputError if out of range."""

    palm_aside_mm: float = setting(3.0, "Position of the palm, sideways.", limits=(0, 100))
    palm_height_mm: float = setting(3.0, "Height of the palm.", limits=(0, 100))
    palm_tilt_deg: float = setting(5.0, "Tilt of the palm.", limits=(0, 60))
    palm_turn_deg: float = setting(5.0, "Rotation of the palm about its normal.", limits=(0, 90))
    temperature_k: float = setting(1.0, "Air temperature minus the stated one.", limits=(0, 15))
    unit_position_mm: float = setting(0.5, "Position of each unit.", limits=(0, 10))
    unit_angle_deg: float = setting(0.3, "Rotation of each unit.", limits=(0, 10))
    strength: float = setting(0.05, "Strength of each transducer, relative.", limits=(0, 1))
    resonance_hz: float = setting(180.0, "Resonance of each transducer; 180 Hz: .2 rad.", limits=(0, 2000))
    dead: float = setting(0.01, "Share of the transducers that are silent.", limits=(0, 0.5))
    frequency: float = setting(1e-4, "Frequency of the ultrasound, relative.", limits=(0, 0.02))
    echo: float = setting(0.1, "Echo between palm and array: product of both reflection factors.", limits=(0, 1))

    def __post_init__(self) -> None:
        check_settings(self)


def load_laboratory(path: str | os.PathLike[str]) -> Laboratory:
    """Read the uncertainties of a laboratory; a missing key takes its default.

    Raises MissingFileError if the file does not exist; BrokenFileError if a key or a value is invalid.
    """
    content = read_toml(path, "a TOML file with the uncertainties of a laboratory")
    try:
        found: Laboratory = from_plain(Laboratory, content)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong
    return found


def save_laboratory(laboratory: Laboratory, path: str | os.PathLike[str]) -> None:
    """Write the uncertainties of a laboratory atomically, each with its meaning. Raises FileError if it fails."""
    lines = [f"{one.name} = {getattr(laboratory, one.name)!r}  # {one.metadata['help']}" for one in fields(laboratory)]
    head = ["# Standard uncertainties (k = 1) of a laboratory, for midair budget --lab. Replace what you know better."]
    with atomic_file(Path(path)) as partial:
        Path(partial).write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")
