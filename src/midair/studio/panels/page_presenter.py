"""Who makes the stimuli of a session felt: the studio's own player, or the experimenter, who is told on the page."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from midair.study import Stimulus


@dataclass(slots=True, kw_only=True, eq=False)
class PagePresenter:
    """Presents what a session asks for: drives by the player, objects by the experimenter, who is told on his page.

    Attributes
    ----------
    play : callable
        Plays the drive of a path at a share of its pressure; returns when it is over.
    wait : callable
        Lets the player present silence for a while.
    quiet_s : float
        How long a stimulus of silence lasts, in s: as long as the drives, or the end of the wait would tell. 0 where
        the experimenter presents everything.
    stop : callable
        STOP, from any thread.
    tell : callable
        Shows the experimenter what to do.
    folder : Path
        Of the study, in which its drives are.
    """

    play: Callable[[Path, float], None]
    wait: Callable[[float], None]
    quiet_s: float = 0.0
    stop: Callable[[], None]
    tell: Callable[[str], None]
    folder: Path
    done: threading.Event = field(default_factory=threading.Event)
    ended: threading.Event = field(default_factory=threading.Event)

    def present(self, stimulus: Stimulus) -> None:
        """Present it; return when it is over."""
        if stimulus.kind == "drive":
            self.play(self.folder / stimulus.source, stimulus.share)
            return
        if stimulus.kind == "silence" and self.quiet_s:
            self.wait(self.quiet_s)
            return
        self.done.clear()
        self.tell("present nothing, and wait" if stimulus.kind == "silence" else f"present: {stimulus.source}")
        while not self.done.wait(0.1):
            if self.ended.is_set():
                return
        self.tell("")

    def silence(self) -> None:
        """End it at once."""
        self.ended.set()
        self.stop()
