"""Units of an array: their interface, their state, and the part that all arrays of units share."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.devices.interface import ArrayDevice
from midair.errors import DeviceStateError, TooHotError
from midair.model import Placement

U = TypeVar("U", bound="Units")


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


class Units(Protocol):
    """Open units of an array; instants are device time in ns, the same on all units."""

    @property
    def emulated(self) -> bool:
        """True if an emulator answers, as far as it reports it."""
        ...

    @property
    def failsafe(self) -> float:
        """Time without a message after which units may silence themselves, in s; 0 if unknown."""
        ...

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""
        ...

    def now(self) -> int:
        """Device time, in ns."""
        ...

    def state(self) -> UnitsState | None:
        """Current state of the units; None if it cannot be queried. The query also resets the failsafe timer."""
        ...

    def silence(self) -> None:
        """Set all transducers to intensity 0 at once and cancel pending switches; callable from any thread."""
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


class Banks(Units, Protocol):
    """Units with two banks, 0 and 1; one plays while the other is written."""

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

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive bank.

        `phases` has shape (frame, unit, transducer of the unit), `intensity` the same or (frame,); `divider` is the
        number of ultrasound periods per frame.
        """
        ...

    def switch(self, bank: int, instant: int) -> None:
        """Play a bank once from its first pattern, from an instant on; `TooLateError` if the instant is too near."""
        ...

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise DeviceError as soon as the link to a unit is lost."""
        ...

    def emitting(self) -> bool:
        """True if the device reports that patterns play."""
        ...


class UnitsArray(ArrayDevice, Generic[U]):
    """An array of units, open between `connect` and `close`; the subclasses differ in how they send frames.

    `connect` opens the units. The other parameters are as in `ArrayDevice`.
    """

    def __init__(
        self,
        connect: Callable[[Placement], U],
        placement: Placement,
        *,
        name: str,
        simulated: bool = False,
        gated: bool = True,
        exclusive: str | None = None,
    ) -> None:
        self.name, self.placement, self.array = name, placement, placement.array()
        self.simulated, self.gated, self.exclusive = simulated, gated, exclusive
        self._connect = connect
        self._units: U | None = None
        self._lock = threading.RLock()

    @property
    def units(self) -> U:
        """The open units; DeviceStateError if they are closed."""
        if self._units is None:
            raise DeviceStateError(f"{self.name}: expected open before play")
        return self._units

    def open(self) -> None:
        """Open the device; it is silent."""
        if self._units is None:
            self._units = self._connect(self.placement)
            # The name is not reliable: the SDK's search prefers a running simulator to real units.
            self.simulated = self._units.emulated

    def close(self) -> None:
        """Close the device."""
        # With the lock a silence from another thread returns only after closing has silenced the device.
        with self._lock:
            units, self._units = self._units, None
            if units is not None:
                units.close()
