"""The two pattern memories of an array: what streaming needs of an SDK, and no more."""

from dataclasses import dataclass
from typing import Protocol

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.errors import TooHotError


class TooLateError(Exception):
    """The device will not switch at an instant so near."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitsState:
    """What the units of an array say of themselves, as far as their SDK can ask; units are counted from 0.

    Attributes
    ----------
    silenced : tuple of int
        Units that their failsafe keeps silent, whatever is sent to them.
    hot : tuple of int
        Units whose heat sensor has tripped.
    errors : tuple of str or None
        What units counted since they were opened and ought not to have, in words; None where they do not count.
    """

    silenced: tuple[int, ...] = ()
    hot: tuple[int, ...] = ()
    errors: tuple[str, ...] | None = None

    def check_heat(self, when: str = "before the first frame") -> None:
        """Raise TooHotError if a unit is too hot; `when` completes the message."""
        if self.hot:
            raise TooHotError(
                f"array: expected units that are not too hot, got {name_units(self.hot)} too hot {when}; "
                "let them cool; a lower --level or pauses help"
            )

    def __str__(self) -> str:
        heat = [f"unit {unit} too hot" for unit in self.hot] or ["not too hot"]
        counted = [] if self.errors is None else self.errors or ["no errors"]
        return ", ".join([*heat, *counted])


def name_units(units: tuple[int, ...]) -> str:
    """Units by their numbers, such as "unit 1" or "units 0, 2"."""
    return f"unit {units[0]}" if len(units) == 1 else "units " + ", ".join(map(str, units))


class Banks(Protocol):
    """An open array with two memories, 0 and 1, of which one plays while the other is written.

    Instants are device time in ns, and the same on all units.
    """

    @property
    def emulated(self) -> bool:
        """Whether what answers is an emulator, as far as it says so itself."""
        ...

    @property
    def frames_max(self) -> int:
        """How many patterns a memory holds."""
        ...

    @property
    def margin(self) -> int:
        """How long before its instant a switch must arrive, in ns."""
        ...

    @property
    def patience(self) -> int:
        """How long an order may take to arrive, also at a second attempt, in ns."""
        ...

    @property
    def failsafe(self) -> float:
        """After how long without a word units may silence themselves, in s; 0 if nobody knows."""
        ...

    def set_silencer(self, silencer: Silencer) -> None:
        """Set over how long the firmware spreads steps."""
        ...

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns and then a silent one into a memory that does not play; played once, it ends silent.

        Parameters
        ----------
        bank : int
            0 or 1.
        phases : ndarray of uint8, shape (frame, unit, transducer of the unit)
        intensity : ndarray of uint8, shape (frame,) or (frame, unit, transducer of the unit)
        divider : int
            Ultrasound periods in a frame.
        """
        ...

    def switch(self, bank: int, instant: int) -> None:
        """Play a memory from its first pattern on, once, from an instant on; `TooLateError` when it is too near."""
        ...

    def now(self) -> int:
        """Device time, in ns."""
        ...

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise DeviceError as soon as the link to a unit is lost."""
        ...

    def silence(self) -> None:
        """All transducers to intensity 0 at once, whatever was to come; callable from any thread."""
        ...

    def emitting(self) -> bool:
        """Whether the device says that patterns play."""
        ...

    def state(self) -> UnitsState | None:
        """What the units say of themselves now; None where they cannot be asked."""
        ...

    def release(self) -> None:
        """Let units that their failsafe has silenced sound again; whoever calls this has made them play silence."""
        ...

    def describe(self) -> dict[str, str]:
        """What the device says of itself: units, firmware, link, buffers, failsafe."""
        ...

    def close(self) -> None:
        """Let go of the device."""
        ...
