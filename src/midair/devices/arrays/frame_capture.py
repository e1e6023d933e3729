"""Which frames of a stream are known to have sounded: the units are asked, block after block."""

from midair.devices.arrays.banks import Banks, UnitsState, name_units
from midair.errors import DeviceError, SilentFramesError


class FrameCapture:
    """What is known of the frames of a stream.

    A unit that hears nothing of the computer for as long as its failsafe waits goes silent, and stays so whatever is
    sent to it. An answer without that says that all went well up to then, and will for as long again.

    Parameters
    ----------
    banks : Banks
        That play.
    period : int
        Duration of a frame, in ns.
    total : int
        Frames in all, with repeats.
    """

    def __init__(self, banks: Banks, period: int, total: int) -> None:
        self._banks, self._period, self._total = banks, period, total
        self._well = banks.now()
        self._blocks: list[tuple[int, int]] = []
        self._ordered = 0
        self._state: UnitsState | None = None

    def order(self, start: int, frames: int) -> None:
        """Take down that the next frames were ordered to begin at an instant."""
        self._blocks.append((start, self._ordered))
        self._ordered += frames

    def ask(self) -> None:
        """Ask the units how they are.

        Raises
        ------
        TooHotError
            If one is too hot.
        SilentFramesError
            If the failsafe of one has silenced it before its last frame was over.
        """
        asked = self._banks.now()
        state = self._state = self.check_heat()
        silenced = () if state is None else state.silenced
        if not silenced:
            self._well = asked
            # Streaming asks after a block has begun: those before it are over, and can no longer become silent.
            self._blocks = self._blocks[-1:]
            return
        first = self._first_after(self._well + round(self._banks.failsafe * 1e9))
        if first < self._total:
            raise SilentFramesError(
                f"array: expected every frame to sound, but the failsafe silenced {name_units(silenced)}: "
                f"{self._words(first)} were silent; the computer said nothing for {self._banks.failsafe:g} s: look for "
                "what held it up (sleep, other programs), then play again"
            )

    def check_heat(self) -> UnitsState | None:
        """Ask the units for their state and return it; raise TooHotError if one is too hot."""
        over, state = self._first_after(self._banks.now()), self._banks.state()
        if state is not None:
            state.check_heat(f"after {over} of {self._total} frames ({over * self._period / 1e9:.3f} s)")
        return state

    def told(self, wrong: DeviceError) -> DeviceError:
        """An error that ended the stream, with the frames that may not have sounded."""
        first = self._first_after(self._well)
        return type(wrong)(f"{wrong}; {self._words(first)} may not have sounded") if first < self._total else wrong

    def units(self) -> str:
        """How the units were, in words; empty where they cannot be asked."""
        return "" if self._state is None else str(self._state)

    def _first_after(self, instant: int) -> int:
        """The first frame that was not over at an instant."""
        if not self._blocks:
            return 0
        ends = [*(first for _, first in self._blocks[1:]), self._ordered]
        for (start, first), end in zip(self._blocks, ends, strict=True):
            over = first + max(0, (instant - start) // self._period)
            if over < end:
                return over
        return self._ordered

    def _words(self, first: int) -> str:
        last, second = self._total - 1, self._period / 1e9
        which = f"frame {first}" if first == last else f"frames {first} to {last}"
        return f"{which} of {self._total} ({first * second:.3f} to {self._total * second:.3f} s)"
