"""Record of the frames of a stream that have certainly sounded, from queries of the units."""

from midair.devices.arrays.banks import Banks, UnitsState, name_units
from midair.errors import DeviceError, SilentFramesError


class FrameCapture:
    """Tracks the frames of a stream on playing banks; `period` of a frame in ns, `total` frames including repeats.

    A unit without a message for its failsafe time goes silent and stays silent. An answer without an active failsafe
    confirms playback up to then, and for one more failsafe time.
    """

    def __init__(self, banks: Banks, period: int, total: int) -> None:
        self._banks, self._period, self._total = banks, period, total
        self._confirmed = banks.now()
        self._blocks: list[tuple[int, int]] = []
        self._ordered = 0
        self._state: UnitsState | None = None

    def add_block(self, start: int, frames: int) -> None:
        """Record that the next frames were scheduled for an instant."""
        self._blocks.append((start, self._ordered))
        self._ordered += frames

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
        over, state = self._first_after(self._banks.now()), self._banks.state()
        if state is not None:
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
        """First frame that was not over at an instant."""
        if not self._blocks:
            return 0
        ends = [*(first for _, first in self._blocks[1:]), self._ordered]
        for (start, first), end in zip(self._blocks, ends, strict=True):
            over = first + max(0, (instant - start) // self._period)
            if over < end:
                return over
        return self._ordered

    def _frames_text(self, first: int) -> str:
        last, second = self._total - 1, self._period / 1e9
        which = f"frame {first}" if first == last else f"frames {first} to {last}"
        return f"{which} of {self._total} ({first * second:.3f} to {self._total * second:.3f} s)"
