"""The interface of an array with two pattern banks, which streaming uses."""

from dataclasses import dataclass
from typing import Protocol

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.errors import TooHotError


class TooLateError(Exception):
    """The instant of a switch is too near."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitsState:
    """State of the units of an array, as far as their SDK reports it; units are counted from 0."""

    silenced: tuple[int, ...] = ()
    """Units that their failsafe keeps silent."""
    hot: tuple[int, ...] = ()
    """Units whose temperature sensor has tripped."""
    errors: tuple[str, ...] | None = None
    """Errors counted since opening, as text; None if the units do not count."""

    def check_heat(self, when: str = "before the first frame") -> None:
        """Raise TooHotError if a unit is too hot; `when` completes the message."""
        if self.hot:
            raise TooHotError(
                f"array: expected units that are not too hot, got {name_units(self.hot)} too hot {when}; "
                "let them cool, then use a lower --level or pauses"
            )

    def __str__(self) -> str:
        heat = [f"unit {unit} too hot" for unit in self.hot] or ["not too hot"]
        counted = [] if self.errors is None else self.errors or ["no errors"]
        return ", ".join([*heat, *counted])


def name_units(units: tuple[int, ...]) -> str:
    """Units by number, such as "unit 1" or "units 0, 2"."""
    return f"unit {units[0]}" if len(units) == 1 else "units " + ", ".join(map(str, units))


class Banks(Protocol):
    """An open array with two banks, 0 and 1; one plays while the other is written.

    Instants are device time in ns, the same on all units.
    """

    @property
    def emulated(self) -> bool:
        """True if an emulator answers, as far as it reports it."""
        ...

    @property
    def frames_max(self) -> int:
        """Number of patterns per bank."""
        ...

    @property
    def margin(self) -> int:
        """Minimum time between the arrival of a switch and its instant, in ns."""
        ...

    @property
    def patience(self) -> int:
        """Maximum time for a command to arrive, including a second attempt, in ns."""
        ...

    @property
    def failsafe(self) -> float:
        """Time without a message after which units may silence themselves, in s; 0 if unknown."""
        ...

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""
        ...

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive bank.

        `phases` has shape (frame, unit, transducer of the unit), `intensity` the same or (frame,); `divider` is the
        number of ultrasound periods per frame.
        """
        ...

    def switch(self, bank: int, instant: int) -> None:
        """Play a bank once from its first pattern, from an instant on; `TooLateError` if the instant is too near."""
        ...

    def now(self) -> int:
        """Device time, in ns."""
        ...

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise DeviceError as soon as the link to a unit is lost."""
        ...

    def silence(self) -> None:
        """Set all transducers to intensity 0 at once and cancel pending switches; callable from any thread."""
        ...

    def emitting(self) -> bool:
        """True if the device reports that patterns play."""
        ...

    def state(self) -> UnitsState | None:
        """Current state of the units; None if it cannot be queried."""
        ...

    def release(self) -> None:
        """Release the failsafe of the units; the caller must have silenced them before."""
        ...

    def describe(self) -> dict[str, str]:
        """Units, firmware, link, buffers and failsafe of the device."""
        ...

    def close(self) -> None:
        """Close the device."""
        ...
