"""An array that takes single frames, each with its instant: for touch that is made while it is felt.

Two memories that swap need their frames 10 ms before (`streaming`). Here every frame is a message of its own and sounds
from its instant until the next one does. Nothing in the units knows an end: what silences them when nobody speaks any
more is their own failsafe, which is therefore short, and no heartbeat speaks in the player's place.
"""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from midair.devices.arrays.banks import UnitsState
from midair.devices.arrays.silencer import Silencer
from midair.devices.exposure_check import ExposureClearance
from midair.devices.frame_bytes import TICK, Bytes, divider, intensity_bytes, phase_bytes
from midair.devices.interface import ArrayDevice, PlayReport
from midair.devices.safety import log_end, log_order
from midair.errors import DeviceStateError, ExposureError, InputError
from midair.model import Drive, Medium, Placement, Progress

Put = Callable[[Bytes, int, int], None]
"""Called with phases (unit, transducer of the unit), one intensity for all, and the instant of device time in ns."""


class ImmediateUnits(Protocol):
    """Open units that take single frames; as `Banks`, where they share a name."""

    @property
    def emulated(self) -> bool:
        """Whether what answers is an emulator."""
        ...

    @property
    def failsafe(self) -> float:
        """After how long without a word units silence themselves, in s."""
        ...

    def set_silencer(self, silencer: Silencer) -> None:
        """Set over how long the firmware spreads steps."""
        ...

    def now(self) -> int:
        """Device time, in ns."""
        ...

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Send a frame that sounds from an instant on, and do not wait for it.

        Raises
        ------
        DeviceError
            If an earlier frame met a link that is lost, or units that are too hot or that their failsafe has silenced.
        """
        ...

    def sent(self, number: int) -> int:
        """When a frame left, in ns of `time.monotonic_ns`: counted from 0, one of the last 64; 0 if it did not."""
        ...

    def told(self) -> dict[str, int]:
        """What became of all frames: sent, answered, lost (no answer came), late and crowded (never sent)."""
        ...

    def state(self) -> UnitsState | None:
        """What the units say of themselves now; None where they cannot be asked."""
        ...

    def silence(self) -> None:
        """All transducers to intensity 0 at once; callable from any thread."""
        ...

    def release(self) -> None:
        """Let units sound again that their failsafe has silenced."""
        ...

    def describe(self) -> dict[str, str]:
        """What the device says of itself."""
        ...

    def close(self) -> None:
        """Let go of the device."""
        ...


class ImmediateArray(ArrayDevice):
    """Plays frames as they are made, and is silent at all other times.

    Parameters
    ----------
    connect : callable
        Opens the units, without a heartbeat and with a short failsafe.
    placement : Placement
        Placement of the units.
    name : str
        What it was opened by.
    silencer : Silencer
        Over how long the firmware spreads steps.
    hold : float
        How long before its instant a frame is sent at most, in s: what units may still hold when they are silenced.
    simulated, gated, exclusive
        As in `ArrayDevice`.
    """

    def __init__(
        self,
        connect: Callable[[Placement], ImmediateUnits],
        placement: Placement,
        *,
        name: str,
        silencer: Silencer | None = None,
        hold: float = 0.006,
        simulated: bool = False,
        gated: bool = True,
        exclusive: str | None = None,
    ) -> None:
        self.name, self.placement, self.array = name, placement, placement.array()
        self.simulated, self.gated, self.exclusive = simulated, gated, exclusive
        self.silencer, self.hold = silencer or Silencer(phase=0, intensity=0), hold
        self._connect = connect
        self._units: ImmediateUnits | None = None
        self._sounds = False

    @property
    def units(self) -> ImmediateUnits:
        """The open units; DeviceStateError when they are not."""
        if self._units is None:
            raise DeviceStateError(f"{self.name}: expected open before play")
        return self._units

    @property
    def emitting(self) -> bool:
        """Whether a frame that sounds was the last."""
        return self._units is not None and self._sounds

    def open(self) -> None:
        """Take hold of the device; it is silent."""
        if self._units is None:
            self._units = self._connect(self.placement)
            self.simulated = self._units.emulated

    @contextmanager
    def frames_to_come(
        self, admission: ExposureClearance, *, source: str | Path = "live", room: Medium | None = None
    ) -> Generator[Put]:
        """While inside, frames no stronger than what `admit_level` was asked for sound when they are put.

        The order is in the log before the first, its end after the last, and `midair stop` silences it. Leaving
        silences, whatever the reason.

        Raises
        ------
        MismatchError, DeviceStateError
            If it was admitted elsewhere, or the device is not open.
        ExposureError
            From a frame that is stronger than what was admitted.
        StoppedError
            From the first frame after somebody asked for silence.
        TooHotError
            Before the first frame or from a later one, if a unit is too hot.
        """
        admission.check_array(self)
        units, strongest = self.units, admission.strongest

        def put(phases: Bytes, intensity: int, instant: int) -> None:
            if intensity > strongest:
                raise ExposureError(f"{self.name}: expected intensities up to {strongest} of 255, got {intensity}")
            with self.sounding():
                self._sounds = intensity > 0
                units.put(phases, intensity, instant)

        with self._order.held(self.name, self.exclusive, self.silence):
            self._order.check(self.name)
            number = log_order(source, self.name, admission, simulated=self.simulated, room=room)
            before = units.told()
            try:
                with self._playing(units):
                    yield put
                self._order.check(self.name)
            except BaseException as end:
                log_end(number, source, self.name, *self._ended(end))
                raise
            log_end(number, source, self.name, "played", report=_since(before, units.told()))

    @contextmanager
    def _playing(self, units: ImmediateUnits) -> Generator[None]:
        self._make_ready(units)
        try:
            self._plays = True
            yield
        except BaseException:
            self._silence_after_an_error()
            raise
        finally:
            self._plays = False
        self.silence()

    def _make_ready(self, units: ImmediateUnits) -> None:
        """Leave the units silent and ready to sound; raise TooHotError if one is too hot."""
        units.silence()
        state = units.state()
        if state is not None:
            state.check_heat()
        # Without a heartbeat the failsafe has acted since the last order.
        units.release()
        units.set_silencer(self.silencer)

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Put every frame of a drive at its instant; for drives whose frames are there already, memories do better."""
        units, period = self.units, divider(drive.rate) * TICK
        phases, intensity = phase_bytes(drive, self.placement.units), intensity_bytes(drive, self.placement.units)
        if intensity.ndim > 1:
            raise InputError(f"{self.name}: expected transducers that are equally loud, got a level for each")
        self._make_ready(units)
        total, ahead, before = drive.frames * repeats, round(self.hold * 1e9), units.told()
        first = -(-(units.now() + round(delay * 1e9) + 2 * ahead) // period) * period
        for number in range(total):
            instant = first + number * period
            while (left := instant - ahead - units.now()) > 0:
                time.sleep(left * 1e-9)
            at = number % drive.frames
            with self.sounding():
                self._sounds = True
                units.put(phases[at], int(intensity[at]), instant)
            if progress and number % 100 == 0:
                progress(number, total)
        while (left := first + total * period - units.now()) > 0:
            time.sleep(left * 1e-9)
        if progress:
            progress(total, total)
        told = _since(before, units.told())
        late = told["late"] + told["crowded"]
        return PlayReport(
            frames=total, duration=total * period / 1e9, late=late, start=first, silencer=str(self.silencer)
        )

    def silence(self) -> None:
        """Stop all sound at once, from any thread; and again when what units may still have held has sounded."""
        sounded, self._sounds = self._sounds, False
        units = self._units
        if units is None:
            return
        units.silence()
        if sounded:
            # Nobody has seen yet whether silence cancels frames that wait in real units: so it is said again.
            time.sleep(self.hold)
            units.silence()

    def close(self) -> None:
        """Let go of the device."""
        units, self._units = self._units, None
        self._sounds = False
        if units is not None:
            units.close()

    def describe(self) -> dict[str, str]:
        """What the units say of themselves, and how frames reach them."""
        return {**self.units.describe(), "frames": "one by one, each with its instant; no heartbeat"}


def _since(before: dict[str, int], now: dict[str, int]) -> dict[str, int]:
    """Counts of one order: units count all frames since they were opened."""
    return {name: count - before[name] for name, count in now.items()}
