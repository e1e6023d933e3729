"""Playback of a drive of any length through two banks: one plays while the other is written; they swap at exact
instants.

Every block ends with a silent pattern, which is not reached if the next block arrives in time. If the computer or the
network stalls, the array therefore becomes silent instead of repeating a frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from midair.devices.arrays.banks import Banks, TooLateError, UnitsArray, UnitsState, name_units
from midair.devices.arrays.silencer import SilencerChoice, silencer_named
from midair.devices.frame_bytes import TICK, Bytes, divider, intensity_bytes, phase_bytes
from midair.devices.interface import PlayReport
from midair.errors import DeviceError, SilentFramesError, StoppedError, TooHotError
from midair.model import Drive, Placement, Progress
from midair.streaming import ArrivingFrames, read_frames

MS = 1_000_000
QUERY_INTERVAL = 50 * MS
"""Maximum time between two temperature queries, in ns."""

Switch = Callable[[int, int], None]
"""Called with (bank, instant)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveStream:
    """Encoded frames with their timing; `phases` and `intensity` as in `Banks.load`, also as lazy frames."""

    phases: Bytes
    intensity: Bytes
    divider: int
    """Ultrasound periods per frame."""
    repeats: int = 1
    """Number of consecutive repeats without a gap."""
    delay: float = 0.0
    """Time from the order to the first frame, in s."""
    block: float = 0.25
    """Maximum length of a block, in s; after a stall at most two blocks still sound."""
    arriving: ArrivingFrames | None = None
    """Frames that are still being solved: no block is begun before its frames are there."""

    @property
    def total(self) -> int:
        """Number of frames including repeats."""
        return len(self.phases) * self.repeats

    @property
    def period(self) -> int:
        """Duration of a frame, in ns."""
        return self.divider * TICK

    def frames_in_block(self, frames_max: int) -> int:
        """Frames per block; one place of the bank is reserved for the silent pattern."""
        return max(1, min(frames_max - 1, int(self.block * 1e9 / self.period)))

    def ready(self, first: int, size: int) -> int:
        """Number of frames of the next block; 0 while too few are there. Raises the error of the frames to come."""
        frame = first % len(self.phases)
        if self.arriving is None or self.arriving.there == len(self.phases):
            return size
        count = min(self.arriving.there - frame, size)
        # A short block needs as many messages as a long one.
        return count if count >= min(size // 4, len(self.phases) - frame) else 0

    def part(self, first: int, count: int) -> tuple[Bytes, Bytes]:
        """Phases and intensities of `count` frames from `first` on, counted across repeats."""
        frames, end = len(self.phases), min(first + count, self.total)
        parts: list[tuple[Bytes, Bytes]] = []
        while first < end:
            at = first % frames
            till = min(frames, at + end - first)
            parts.append((read_frames(self.phases, at, till), read_frames(self.intensity, at, till)))
            first += till - at
        return np.concatenate([phases for phases, _ in parts]), np.concatenate([levels for _, levels in parts])


class FrameCapture:
    """Tracks the frames of a stream on playing banks; `period` of a frame in ns, `total` frames including repeats.

    A unit without a message for its failsafe time goes silent and stays silent. An answer without an active failsafe
    confirms playback up to then, and for one more failsafe time.
    """

    def __init__(self, banks: Banks, period: int, total: int) -> None:
        self._banks, self._period, self._total = banks, period, total
        self.begin = self._confirmed = banks.now()
        self.start: int | None = None
        self.late = self.gap = 0
        self._blocks: list[tuple[int, int]] = []
        self.ordered = self._over = 0
        """`ordered`: number of frames that were scheduled; the next one has this index."""
        self._state: UnitsState | None = None

    def add_block(self, start: int, frames: int, *, planned: int) -> None:
        """Record that the next frames were scheduled for an instant, instead of a planned one."""
        self._blocks.append((start, self.ordered))
        self.ordered += frames
        self.start = planned if self.start is None else self.start
        if start > planned:
            self.late, self.gap = self.late + frames, self.gap + start - planned

    def resume(self) -> None:
        """Continue at the frame at which heat was found, after a pause."""
        self.ordered, self._blocks, self._confirmed = self._over, [], self._banks.now()

    def query(self) -> None:
        """Query the units; raise TooHotError, or SilentFramesError if a failsafe acted before the last frame ended."""
        asked = self._banks.now()
        state = self._state = self.check_heat()
        silenced = () if state is None else state.silenced
        if not silenced:
            self._confirmed = asked
            # The query follows the start of a block; all earlier blocks are over.
            self._blocks = self._blocks[-1:]
            return
        first = self._first_after(self._confirmed + round(self._banks.failsafe * 1e9))
        if first < self._total:
            raise SilentFramesError(
                f"array: expected every frame to sound, but the failsafe silenced {name_units(silenced)}: "
                f"{self._frames_text(first)} were silent; the computer sent nothing for {self._banks.failsafe:g} s; "
                "prevent sleep, close other programs, then play again"
            )

    def check_heat(self) -> UnitsState | None:
        """Query the state of the units and return it; raise TooHotError if one is too hot."""
        self._over, state = self._first_after(self._banks.now()), self._banks.state()
        if state is not None:
            over = self._over
            state.check_heat(f"after {over} of {self._total} frames ({over * self._period / 1e9:.3f} s)")
        return state

    def with_frames(self, wrong: DeviceError) -> DeviceError:
        """Add the frames that may not have sounded to an error that ended the stream."""
        first = self._first_after(self._confirmed)
        return (
            type(wrong)(f"{wrong}; {self._frames_text(first)} may not have sounded") if first < self._total else wrong
        )

    def units(self) -> str:
        """Last state of the units as text; empty if it cannot be queried."""
        return "" if self._state is None else str(self._state)

    def _first_after(self, instant: int) -> int:
        if not self._blocks:
            return self.ordered
        ends = [*(first for _, first in self._blocks[1:]), self.ordered]
        for (start, first), end in zip(self._blocks, ends, strict=True):
            over = first + max(0, (instant - start) // self._period)
            if over < end:
                return over
        return self.ordered

    def _frames_text(self, first: int) -> str:
        last, second = self._total - 1, self._period / 1e9
        which = f"frame {first}" if first == last else f"frames {first} to {last}"
        return f"{which} of {self._total} ({first * second:.3f} to {self._total * second:.3f} s)"


def play_stream(
    stream: DriveStream,
    banks: Banks,
    *,
    progress: Progress | None = None,
    switch: Switch | None = None,
    cool: Callable[[TooHotError], None] | None = None,
) -> PlayReport:
    """Play a stream to its end on open banks of which 0 is active and silent.

    `progress` is called with (frames begun, total frames) at the start of each block, and at the end. `switch` replaces
    `Banks.switch` and raises if sound is no longer permitted. `cool` is called if a unit is too hot: it silences the
    banks and returns when the stream may continue at the frame where it paused; without it TooHotError ends the stream.
    In the report, ``late`` counts the frames of late blocks and ``gap`` is the silence before them, in s. Raises
    SilentFramesError if a failsafe acted (queried once per block, and at the end); DeviceError if the link is lost, or
    the device refuses a switch three times.
    """
    capture = FrameCapture(banks, stream.period, stream.total)
    while True:
        try:
            _play(stream, banks, capture, progress, switch or banks.switch)
            break
        except TooHotError as hot:
            if cool is None:
                raise
            cool(hot)
            capture.resume()
        except (SilentFramesError, StoppedError):
            raise
        except DeviceError as wrong:
            raise capture.with_frames(wrong) from wrong
    return PlayReport(
        frames=stream.total,
        duration=stream.total * stream.period / 1e9,
        late=capture.late,
        start=capture.start,
        gap=capture.gap / 1e9,
        units=capture.units(),
    )


def _play(stream: DriveStream, banks: Banks, capture: FrameCapture, progress: Progress | None, switch: Switch) -> None:
    size, bank, planned = stream.frames_in_block(banks.frames_max), 1, None
    while (done := capture.ordered) < stream.total:
        while not (count := stream.ready(done, size)):
            # Silent: the block before ended. The units' failsafe needs messages.
            capture.query()
            banks.wait_until(banks.now() + QUERY_INTERVAL)
        phases, intensity = stream.part(done, count)
        banks.load(bank, phases, intensity, stream.divider)
        if planned is None:
            # The delay counts from the order, before the first block was written.
            planned = _aligned(max(capture.begin + round(stream.delay * 1e9), _earliest(banks)), stream.period)
        start = _send_switch(banks, switch, bank, planned, stream.period)
        capture.add_block(start, len(phases), planned=planned)
        # Half a frame into the new bank: only then is the other bank certainly inactive.
        _wait(banks, capture, start + stream.period // 2)
        capture.query()
        if progress:
            progress(done, stream.total)
        bank, planned = 1 - bank, start + len(phases) * stream.period
    _wait(banks, capture, planned or 0)
    capture.query()
    if progress:
        progress(stream.total, stream.total)


def _wait(banks: Banks, capture: FrameCapture, instant: int) -> None:
    """Return at an instant; meanwhile query the temperature."""
    while instant - banks.now() > QUERY_INTERVAL:
        banks.wait_until(banks.now() + QUERY_INTERVAL)
        capture.check_heat()
    banks.wait_until(instant)


def _send_switch(banks: Banks, switch: Switch, bank: int, planned: int, period: int) -> int:
    """Send a switch for its planned instant, or the earliest possible one if that has passed; return the instant."""
    for _ in range(3):
        start = planned if planned >= banks.now() + banks.margin else _aligned(_earliest(banks), period)
        try:
            switch(bank, start)
        except TooLateError:
            continue
        return start
    raise DeviceError(
        f"array: expected a switch {banks.margin / MS:g} ms ahead to arrive in time, it was late three times; "
        "close other programs, or use a wired network without other traffic"
    )


def _earliest(banks: Banks) -> int:
    return banks.now() + banks.margin + banks.patience


def _aligned(instant: int, period: int) -> int:
    """The first multiple of the frame's period at or after an instant."""
    return -(-instant // period) * period


class BankedArray(UnitsArray[Banks]):
    """Streams drives through two banks, and is silent at all other times.

    `connect` opens the device and returns its banks; `silencer` as in `silencer_named`; `block` is the maximum length
    of a block, in s; the other parameters are as in `ArrayDevice`.
    """

    streams = True

    def __init__(
        self,
        connect: Callable[[Placement], Banks],
        placement: Placement,
        *,
        name: str,
        silencer: SilencerChoice = "off",
        block: float = 0.25,
        simulated: bool = False,
        exclusive: str | None = None,
    ) -> None:
        super().__init__(connect, placement, name=name, simulated=simulated, exclusive=exclusive)
        self.silencer: SilencerChoice = silencer
        self.block = block
        self._silenced = 0

    @property
    def emitting(self) -> bool:
        """True if the device reports that it plays."""
        return self._units is not None and self._units.emitting()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Stream every frame through the two banks, and return the result."""
        # Read first, so that a silence during the preparation ends this playback.
        ordered = self._silenced
        banks, ticks = self.units, divider(drive.rate)
        phases = phase_bytes(drive, self.placement.units)
        intensity = intensity_bytes(drive, self.placement.units)
        arriving = drive.phase if isinstance(drive.phase, ArrivingFrames) else None
        silencer = silencer_named(self.silencer, drive.rate)
        paused: list[float] = []

        def check() -> None:
            with self.sounding(), self._lock:
                if self._silenced != ordered:
                    raise DeviceError(f"{self.name}: silenced by another thread during playback")

        def switch(bank: int, instant: int) -> None:
            # The lock prevents a silence from another thread between this check and the switch.
            with self.sounding(), self._lock:
                check()
                banks.switch(bank, instant)

        def cool(hot: TooHotError) -> None:
            paused.append(self.wait_while_hot(hot, check))

        # The silencer is set while nothing sounds, and `play_stream` begins on silent banks.
        banks.silence()
        try:
            self._make_ready(banks)
        except TooHotError as hot:
            cool(hot)
        banks.set_silencer(silencer)

        stream = DriveStream(
            phases=phases,
            intensity=intensity,
            divider=ticks,
            repeats=repeats,
            delay=delay,
            block=self.block,
            arriving=arriving,
        )
        report = play_stream(stream, banks, progress=progress, switch=switch, cool=cool)
        return replace(report, silencer=str(silencer), paused=sum(paused))

    def _make_ready(self, banks: Banks) -> None:
        """Refuse units that are too hot, and release an active failsafe; the units are silent."""
        state = banks.state()
        if state is None:
            return
        state.check_heat()
        if state.silenced:
            banks.release()

    def silence(self) -> None:
        """Stop all sound immediately, from any thread; active playback ends with an error."""
        with self._lock:
            if self._units is not None:
                self._silenced += 1
                self._units.silence()

    def describe(self) -> dict[str, str]:
        """Information from the units, and properties of all arrays of this kind."""
        return {
            **self.units.describe(),
            "rate": "any that is 40 kHz / N: 1000 Hz is N = 40",
            "power": "cannot be asked; a unit takes up to 50 W at full drive",
        }
