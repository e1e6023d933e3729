"""An array that plays single frames, each at its instant, for live touch.

Two banks need their frames 10 ms ahead (`streaming`). Here every frame is a separate message and sounds from its
instant until the next frame. There is no end in the units: if messages stop, only their failsafe silences them.
Therefore the failsafe is short and there is no heartbeat.
"""

import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from midair.devices.arrays.banks import CoolingPause, Units, UnitsArray
from midair.devices.arrays.silencer import Silencer
from midair.devices.exposure_check import ExposureClearance
from midair.devices.frame_bytes import TICK, Bytes, divider, intensity_bytes, phase_bytes
from midair.devices.interface import PlayReport
from midair.errors import ExposureError, InputError, TooHotError
from midair.model import Drive, Medium, Placement, Progress

Put = Callable[[Bytes, int, int], None]
"""Called with phases (unit, transducer of the unit), one intensity for all, and the instant of device time in ns."""

OUTCOMES = ("sent", "answered", "lost", "late", "crowded", "hot", "failsafe")
"""Outcomes that units count: frames sent, answered, lost (no answer), late, crowded and hot (never sent); and how often
the failsafe acted."""


class ImmediateUnits(Units, Protocol):
    """Units that accept single frames."""

    def put(self, phases: Bytes, intensity: int, instant: int) -> None:
        """Send a frame that sounds from an instant on, without waiting.

        Raises DeviceError if an earlier frame failed: link lost, units too hot, or failsafe active.
        """

    def skip(self) -> None:
        """Count a frame that is dropped, since a unit is too hot."""

    def sent(self, number: int) -> int:
        """Time at which one of the last 64 frames was sent, in ns of `time.monotonic_ns`; 0 if it was not sent."""
        ...

    def counts(self) -> dict[str, int]:
        """Counts by outcome, see `OUTCOMES`."""
        ...


class ImmediateArray(UnitsArray[ImmediateUnits]):
    """Plays frames while they are computed, and is silent at all other times.

    `connect` opens the units, without a heartbeat and with a short failsafe. `silencer` is off by default. `hold` is
    the maximum time by which a frame is sent ahead of its instant, in s: units may still hold so much when silenced.
    The other parameters are as in `ArrayDevice`.
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
        super().__init__(connect, placement, name=name, simulated=simulated, gated=gated, exclusive=exclusive)
        self.silencer, self.hold = silencer or Silencer(phase=0, intensity=0), hold
        self._pause: CoolingPause | None = None

    @property
    def paused(self) -> bool:
        """True while frames are dropped, since a unit is too hot."""
        return self._pause is not None

    @contextmanager
    def frames_to_come(
        self, clearance: ExposureClearance, *, source: str | Path = "live", room: Medium | None = None
    ) -> Generator[Put]:
        """Yield a function that plays frames up to the level cleared by `check_exposure_level`; silences on exit.

        The order is logged before the first frame and its end after the last; `midair stop` silences the array.

        Raises MismatchError or DeviceStateError if the clearance is for another array or the device is not open;
        ExposureError from a frame that exceeds the cleared level, or once the hours of a day are over; StoppedError
        from the first frame after `midair stop`; TooHotError if a unit is too hot, but with `cooling` frames are
        dropped until all units have cooled, and the error comes after its limit.
        """
        clearance.check_array(self)
        entry: dict[str, object] = {}
        with self._logged(clearance, source, room, entry):
            before = self.units.counts()
            self.resume()
            with self._playing():
                yield partial(self._put, clearance.strongest)
            entry |= _since(before, self.units.counts())

    @contextmanager
    def drives_to_come(self) -> Generator[tuple[Put, Callable[..., tuple[Put, Callable[[str, str], None]]]]]:
        """Yield a function for silent frames, and one that begins an order for a checked drive; all end on exit.

        That one takes the clearance, the source and a report for the end of the order, and returns a function for
        frames up to the level of the drive, and one that logs an event.
        """
        with ExitStack() as orders:

            def begin(clearance: ExposureClearance, source: str | Path, report: dict[str, Any]) -> Any:
                clearance.check_array(self)
                orders.enter_context(self._logged(clearance, source, None, report))
                return partial(self._put, clearance.strongest), self._log

            self.resume()
            with self._playing():
                yield partial(self._put, 0), begin

    def _put(self, strongest: int, phases: Bytes, intensity: int, instant: int) -> None:
        if intensity > strongest:
            raise ExposureError(f"{self.name}: expected intensities up to {strongest} of 255, got {intensity}")
        if intensity:
            self._check_hours()
        with self.sounding():
            if self._pause is not None:
                if not self._pause.over():
                    self.units.skip()
                    return
                self._pause = None
            self._sounds = intensity > 0
            try:
                self.units.put(phases, intensity, instant)
            except TooHotError as hot:
                self.silence()
                self._pause = self.pause(hot)
                self.units.skip()

    def resume(self) -> None:
        """Silence the units and release their failsafe; the next frame sounds, unless they are too hot."""
        self._pause = None
        try:
            self._make_ready(self.units)
        except TooHotError as hot:
            self._pause = self.pause(hot)

    def _make_ready(self, units: ImmediateUnits) -> None:
        """Silence the units and release their failsafe; raise TooHotError if one is too hot."""
        units.silence()
        units.set_silencer(self.silencer)
        state = units.state()
        if state is not None:
            state.check_heat()
        # Without a heartbeat the failsafe has acted since the last order.
        units.release()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Play every frame of a drive at its instant; a `BankedArray` is better for drives that already exist."""
        units, period = self.units, divider(drive.rate) * TICK
        phases, intensity = phase_bytes(drive, self.placement.units), intensity_bytes(drive, self.placement.units)
        if intensity.ndim > 1:
            raise InputError(f"{self.name}: expected one level for all transducers, got one for each")
        self._make_ready(units)
        total, ahead, before = drive.frames * repeats, round(self.hold * 1e9), units.counts()
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
        counts = _since(before, units.counts())
        late = counts["late"] + counts["crowded"]
        return PlayReport(
            frames=total, duration=total * period / 1e9, late=late, start=first, silencer=str(self.silencer)
        )

    def silence(self) -> None:
        """Stop all sound immediately, from any thread; repeated once the frames that units may still hold are over."""
        sounded, self._sounds = self._sounds, False
        units = self._units
        if units is None:
            return
        units.silence()
        if sounded:
            # It is unknown whether silence cancels queued frames in real units; therefore repeat it.
            time.sleep(self.hold)
            units.silence()

    def describe(self) -> dict[str, str]:
        """Information from the units, and the mode of transmission."""
        return {**self.units.describe(), "frames": "one by one, each with its instant; no heartbeat"}


def _since(before: dict[str, int], now: dict[str, int]) -> dict[str, int]:
    """Counts of one order; units count all frames since they were opened."""
    return {name: count - before[name] for name, count in now.items()}
