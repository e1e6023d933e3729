"""A drive of any length through two memories: one plays while the other is written, and they swap on exact instants.

Every block ends with a silent pattern that is never reached as long as the next block comes in time. A computer that
hangs, or a network that stalls, therefore leaves silence and no sound that stands still.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.devices.arrays.banks import Banks, TooLateError
from midair.devices.arrays.frame_capture import FrameCapture
from midair.devices.frame_bytes import TICK, Bytes
from midair.devices.interface import PlayReport
from midair.errors import DeviceError, SilentFramesError, StoppedError, TooHotError
from midair.lazy_frames import read_frames
from midair.model import Progress

MS = 1_000_000
ASKED = 250 * MS
"""Longest time between two questions to the units whether they are too hot, in ns."""

Switch = Callable[[int, int], None]
"""Called with (bank, instant)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveStream:
    """What is to be played.

    Attributes
    ----------
    phases : ndarray or Reel of uint8, shape (frame, unit, transducer of the unit)
    intensity : ndarray or Reel of uint8, shape (frame,) or (frame, unit, transducer of the unit)
    divider : int
        Ultrasound periods in a frame.
    repeats : int
        How often all frames are played, one time after the other without a gap.
    delay : float
        Time from the order to the first frame, in s.
    block : float
        Longest piece that is handed over at once, in s; what a hanging computer can leave behind is at most two.
    """

    phases: Bytes
    intensity: Bytes
    divider: int
    repeats: int = 1
    delay: float = 0.0
    block: float = 0.25

    @property
    def total(self) -> int:
        """Frames with all repeats."""
        return len(self.phases) * self.repeats

    @property
    def period(self) -> int:
        """Duration of a frame, in ns."""
        return self.divider * TICK

    def frames_in_block(self, frames_max: int) -> int:
        """How many frames are handed over at once; one place stays for the silent pattern."""
        return max(1, min(frames_max - 1, int(self.block * 1e9 / self.period)))

    def part(self, first: int, count: int) -> tuple[Bytes, Bytes]:
        """Phases and intensities of `count` frames from `first` on, repeats counted through."""
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
    """Play a stream to its end on banks of which 0 is active and silent.

    Parameters
    ----------
    stream : DriveStream
        What to play.
    banks : Banks
        Open.
    progress : callable, optional
        Called with (frames begun, frames in all) at the start of each block, and at the end.
    switch : callable, optional
        Orders a switch as `Banks.switch` does, which is taken if None; raises when there must be no more sound.

    Returns
    -------
    PlayReport
        ``start`` is the device time of the first frame; ``late`` the frames of blocks that came too late, after
        ``gap`` s of silence in all.

    Raises
    ------
    TooHotError
        If a unit is too hot.
    SilentFramesError
        If the failsafe of a unit has silenced it. Units are asked once a block, and at the end.
    DeviceError
        If the link is lost, or the device refuses a switch three times.
    """
    heard = FrameCapture(banks, stream.period, stream.total)
    try:
        return _play(stream, banks, heard, progress, switch or banks.switch)
    except (SilentFramesError, StoppedError, TooHotError):
        raise
    except DeviceError as wrong:
        raise heard.told(wrong) from wrong


def _play(
    stream: DriveStream, banks: Banks, heard: FrameCapture, progress: Progress | None, switch: Switch
) -> PlayReport:
    size, bank, done = stream.frames_in_block(banks.frames_max), 1, 0
    # Before the first block is written, so that a delay counts from the order.
    begin = banks.now()
    planned = first = 0
    late = gap = 0
    while done < stream.total:
        phases, intensity = stream.part(done, size)
        banks.load(bank, phases, intensity, stream.divider)
        if done == 0:
            planned = first = _aligned(max(begin + round(stream.delay * 1e9), _soon(banks)), stream.period)
        start = _order(banks, switch, bank, planned, stream.period)
        heard.order(start, len(phases))
        if start > planned:
            late, gap = late + len(phases), gap + start - planned
        # Half a frame into the new bank: only then is the other one surely free to be written.
        _wait(banks, heard, start + stream.period // 2)
        heard.ask()
        if progress:
            progress(done, stream.total)
        bank, done, planned = 1 - bank, done + len(phases), start + len(phases) * stream.period
    _wait(banks, heard, planned)
    heard.ask()
    if progress:
        progress(stream.total, stream.total)
    duration = (planned - first - gap) / 1e9
    return PlayReport(
        frames=stream.total, duration=duration, late=late, start=first, gap=gap / 1e9, units=heard.units()
    )


def _wait(banks: Banks, heard: FrameCapture, instant: int) -> None:
    """Return at an instant; during a delay or a slow frame, keep asking whether a unit is too hot."""
    while instant - banks.now() > ASKED:
        banks.wait_until(banks.now() + ASKED)
        heard.check_heat()
    banks.wait_until(instant)


def _order(banks: Banks, switch: Switch, bank: int, planned: int, period: int) -> int:
    """Order a switch at its planned instant, or as soon as the device can when that has gone by; the instant."""
    for _ in range(3):
        start = planned if planned >= banks.now() + banks.margin else _aligned(_soon(banks), period)
        try:
            switch(bank, start)
        except TooLateError:
            continue
        return start
    raise DeviceError(
        f"array: expected a switch {banks.margin / MS:g} ms ahead to be in time, it was not, three times; "
        "close other programs, or use a wired network without other traffic"
    )


def _soon(banks: Banks) -> int:
    return banks.now() + banks.margin + banks.patience


def _aligned(instant: int, period: int) -> int:
    """The first whole multiple of the frame's period from an instant on."""
    return -(-instant // period) * period
