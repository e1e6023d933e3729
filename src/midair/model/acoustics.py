"""Settings of sound propagation: the air, and the directivity of the transducers."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from midair.errors import InputError
from midair.model.medium import Medium

Directivity = Literal["point", "piston", "t4010a1"]
"""Directivity D(theta) in eq. (3) of the paper: omnidirectional, a circular piston in a baffle, or the measured T4010A1
of AUTD3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acoustics:
    """Settings of a transfer matrix apart from positions; a drive stores those that it was solved for."""

    medium: Medium = field(default_factory=Medium)
    """The air, and the surface that reflects the sound."""
    directivity: Directivity = "t4010a1"
    """Directivity of every transducer."""

    def __post_init__(self) -> None:
        if self.directivity not in get_args(Directivity):
            raise InputError(
                f"directivity: expected one of {', '.join(get_args(Directivity))}, got {self.directivity!r}"
            )
