"""Playback of a drive of any length through two banks: one plays while the other is written; they swap at exact
instants.

Every block ends with a silent pattern, which is not reached if the next block arrives in time. If the computer or the
network stalls, the array therefore becomes silent instead of repeating a frame.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.devices.arrays.banks import Banks, TooLateError
from midair.devices.arrays.frame_capture import FrameCapture
from midair.devices.frame_bytes import TICK, Bytes
from midair.devices.interface import PlayReport
from midair.errors import DeviceError, SilentFramesError, StoppedError, TooHotError
from midair.model import Progress
from midair.streaming import read_frames

MS = 1_000_000
QUERY_INTERVAL = 250 * MS
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


def play_stream(
    stream: DriveStream, banks: Banks, *, progress: Progress | None = None, switch: Switch | None = None
) -> PlayReport:
    """Play a stream to its end on open banks of which 0 is active and silent.

    `progress` is called with (frames begun, total frames) at the start of each block, and at the end. `switch` replaces
    `Banks.switch` and raises if sound is no longer permitted. In the report, ``late`` counts the frames of late blocks
    and ``gap`` is the silence before them, in s. Raises TooHotError; SilentFramesError if a failsafe acted (queried
    once per block, and at the end); DeviceError if the link is lost, or the device refuses a switch three times.
    """
    capture = FrameCapture(banks, stream.period, stream.total)
    try:
        return _play(stream, banks, capture, progress, switch or banks.switch)
    except (SilentFramesError, StoppedError, TooHotError):
        raise
    except DeviceError as wrong:
        raise capture.with_frames(wrong) from wrong


def _play(
    stream: DriveStream, banks: Banks, capture: FrameCapture, progress: Progress | None, switch: Switch
) -> PlayReport:
    size, bank, done = stream.frames_in_block(banks.frames_max), 1, 0
    # Read before the first block is written, so that a delay counts from the order.
    begin = banks.now()
    planned = first = 0
    late = gap = 0
    while done < stream.total:
        phases, intensity = stream.part(done, size)
        banks.load(bank, phases, intensity, stream.divider)
        if done == 0:
            planned = first = _aligned(max(begin + round(stream.delay * 1e9), _earliest(banks)), stream.period)
        start = _send_switch(banks, switch, bank, planned, stream.period)
        capture.add_block(start, len(phases))
        if start > planned:
            late, gap = late + len(phases), gap + start - planned
        # Half a frame into the new bank: only then is the other bank certainly inactive.
        _wait(banks, capture, start + stream.period // 2)
        capture.query()
        if progress:
            progress(done, stream.total)
        bank, done, planned = 1 - bank, done + len(phases), start + len(phases) * stream.period
    _wait(banks, capture, planned)
    capture.query()
    if progress:
        progress(stream.total, stream.total)
    duration = (planned - first - gap) / 1e9
    return PlayReport(
        frames=stream.total, duration=duration, late=late, start=first, gap=gap / 1e9, units=capture.units()
    )


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
