"""How sound gets from transducers to where it is wanted: the air, and what a transducer radiates off its axis."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from midair.errors import InputError
from midair.model.medium import Medium

Directivity = Literal["point", "piston", "t4010a1"]
"""D(theta) of the paper's eq. (3): even, a circular piston in a baffle, AUTD3's transducer as measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acoustics:
    """What a transfer matrix needs to know besides places; a drive carries the one that it was solved for.

    Attributes
    ----------
    medium : Medium
        The air, and the surface in it.
    directivity : {"point", "piston", "t4010a1"}
        Of every transducer.
    """

    medium: Medium = field(default_factory=Medium)
    directivity: Directivity = "t4010a1"

    def __post_init__(self) -> None:
        if self.directivity not in get_args(Directivity):
            raise InputError(
                f"directivity: expected one of {', '.join(get_args(Directivity))}, got {self.directivity!r}"
            )
