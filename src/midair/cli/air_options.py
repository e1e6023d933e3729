"""Options for the air of the room, and messages about it."""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from midair.cli.quantities import quantity
from midair.errors import InputError
from midair.model import Medium


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class AirOptions:
    """Air of the room.

    Parameters
    ----------
    temperature
        Air temperature in the room, such as 22C.
    humidity
        Relative humidity of the room, such as 50%; needs --temperature. [default: 50%]
    """

    temperature: Annotated[float | None, quantity("C")] = None
    humidity: Annotated[float | None, quantity("%")] = None

    def medium(self) -> Medium | None:
        """The stated air; None if neither option is given."""
        if self.temperature is None:
            if self.humidity is not None:
                raise InputError("--humidity: expected --temperature with it, got none")
            return None
        return Medium.at(temperature=self.temperature, humidity=0.5 if self.humidity is None else self.humidity)


def print_air(medium: Medium, *, stated: bool) -> None:
    """Print on stderr which air a computation assumes; as a warning if it was not stated."""
    whose = "" if stated else ", assumed; state the air of the room with --temperature and --humidity"
    note_air(f"air: {medium}{whose}", warn=not stated)


def note_air(line: str, *, warn: bool = False) -> None:
    """Print a line on stderr, yellow for a warning."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    console.print(line, style="yellow" if warn else None, markup=False)
