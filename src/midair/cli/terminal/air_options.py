"""The air of the room: options of commands that have no `Settings`, and the line that says which air was taken."""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from midair.cli.terminal.quantities import quantity
from midair.errors import InputError
from midair.model import Medium


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class AirOptions:
    """The air of the room, where somebody states it.

    Parameters
    ----------
    temperature
        Of the air in the room, such as 22C.
    humidity
        Of it, relative, such as 50%, which it is taken for if only the temperature is stated.
    """

    temperature: Annotated[float | None, quantity("C")] = None
    humidity: Annotated[float | None, quantity("%")] = None

    def medium(self) -> Medium | None:
        """The stated air, if any was.

        Raises
        ------
        InputError
            If the humidity alone was stated, or the air is outside of what the formulas hold for.
        """
        if self.temperature is None:
            if self.humidity is not None:
                raise InputError("--humidity: expected --temperature beside it, got none")
            return None
        return Medium.at(temperature=self.temperature, humidity=0.5 if self.humidity is None else self.humidity)


def say_air(medium: Medium, *, stated: bool) -> None:
    """Say on the error stream in which air something is worked out, and whether anybody stated it."""
    whose = "" if stated else ", taken since nobody stated the room's with --temperature and --humidity"
    note_air(f"air: {medium}{whose}", warn=not stated)


def note_air(line: str, *, warn: bool = False) -> None:
    """A line about the air, or about the level, on the error stream."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    console.print(line, style="yellow" if warn else None, markup=False)
