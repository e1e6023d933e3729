"""Units of an array: their interface, their state, and the part that all arrays of units share."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.devices.interface import ArrayDevice, Cooling
from midair.errors import DeviceStateError, TooHotError
from midair.model import Placement

U = TypeVar("U", bound="Units")


COOL = 1.0
"""Time for which no unit may report heat before playback continues, in s."""
POLL = 0.05
"""Interval of state queries during a pause, in s."""


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

    emulated: bool
    """True if an emulator answers, as far as it reports it."""
    failsafe: float
    """Time without a message after which units may silence themselves, in s; 0 if unknown."""

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""

    def now(self) -> int:
        """Device time, in ns."""
        ...

    def state(self) -> UnitsState | None:
        """Current state of the units; None if it cannot be queried. The query also resets the failsafe timer."""
        ...

    def silence(self) -> None:
        """Set all transducers to intensity 0 at once and cancel pending switches; callable from any thread."""

    def release(self) -> None:
        """Release the failsafe of the units; the caller must have silenced them before."""

    def describe(self) -> dict[str, str]:
        """Units, firmware, link, buffers and failsafe of the device."""
        ...

    def close(self) -> None:
        """Close the device."""


class Banks(Units, Protocol):
    """Units with two banks, 0 and 1; one plays while the other is written."""

    frames_max: int
    """Number of patterns per bank."""
    margin: int
    """Minimum time between the arrival of a switch and its instant, in ns."""
    patience: int
    """Maximum time for a command to arrive, including a second attempt, in ns."""

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive bank.

        `phases` has shape (frame, unit, transducer of the unit), `intensity` the same or (frame,); `divider` is the
        number of ultrasound periods per frame.
        """

    def switch(self, bank: int, instant: int) -> None:
        """Play a bank once from its first pattern, from an instant on; `TooLateError` if the instant is too near."""

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise DeviceError as soon as the link to a unit is lost."""

    def emitting(self) -> bool:
        """True if the device reports that patterns play."""
        ...


class CoolingPause:
    """One pause: silences the units, reports and logs it at once; `over` returns True when all units have cooled.

    `log` is called with the event, "pause" or "continue", and its reason.
    """

    def __init__(self, units: Units, hot: TooHotError, cooling: Cooling, log: Callable[[str, str], None]) -> None:
        units.silence()
        self._units, self._cooling, self._log = units, cooling, log
        self._found = str(hot).partition("; ")[0]
        self._began = self._hot = self._asked = time.monotonic()
        cooling.report(
            f"{self._found}; silent until all units have been cool for {COOL:g} s, at most {cooling.limit:g} s"
        )
        log("pause", f"TooHotError: {self._found}")

    @property
    def seconds(self) -> float:
        """Time since the pause began, in s."""
        return time.monotonic() - self._began

    def over(self) -> bool:
        """Query the units if that is due; raise TooHotError once the pause is too long."""
        now = time.monotonic()
        if now - self._asked < POLL:
            return False
        self._asked = now
        state = self._units.state()
        if state is not None and state.hot:
            self._hot = now
        if now - self._hot >= COOL and self._cooling.agreed():
            # Without a heartbeat their failsafe has acted; they are silent.
            self._units.release()
            text = f"units have cooled; playback continues after a pause of {self.seconds:.1f} s"
            self._log("continue", text)
            self._cooling.report(text)
            return True
        if self.seconds > self._cooling.limit:
            lacked = "order to continue" if now - self._hot >= COOL else "second without heat"
            raise TooHotError(
                f"{self._found}, and no {lacked} in a pause of {self._cooling.limit:g} s; let them cool, "
                "then use a lower --level or pauses"
            )
        return False


class UnitsArray(ArrayDevice, Generic[U]):
    """An array of units, open between `connect` and `close`; the subclasses differ in how they send frames."""

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
        self._sounds = False

    @property
    def emitting(self) -> bool:
        """True if the last frame sent was not silent."""
        return self._units is not None and self._sounds

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

    def pause(self, hot: TooHotError) -> CoolingPause:
        """Silence units that are too hot and begin to wait for them; raise `hot` without `cooling`."""
        if self.cooling is None:
            raise hot
        return CoolingPause(self.units, hot, self.cooling, self._log)

    def wait_while_hot(self, hot: TooHotError, check: Callable[[], None]) -> float:
        """Pause until the units have cooled, and return the time in s; `check` raises if playback must end."""
        pause = self.pause(hot)
        while not pause.over():
            check()
            time.sleep(0.02)
        return pause.seconds

    def close(self) -> None:
        """Close the device."""
        # With the lock a silence from another thread returns only after closing has silenced the device.
        with self._lock:
            self._sounds = False
            units, self._units = self._units, None
            if units is not None:
                units.close()
