"""Presents the stimuli of a session: drives by the player, objects by the experimenter."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from midair.study import Stimulus, sound_duration


@dataclass(slots=True, kw_only=True, eq=False)
class PagePresenter:
    """Plays drives, and shows the experimenter which object to present."""

    play: Callable[[Path, float], None]
    """Plays the drive of a path at a share of its pressure; returns when it is over."""
    wait: Callable[[float], None]
    """Presents silence for some seconds."""
    quiet_s: float = 0.0
    """Length of a silent stimulus in s, equal to that of the drives, so that its end reveals nothing.

    0 if the experimenter presents everything.
    """
    stop: Callable[[], None]
    """STOP, from any thread."""
    tell: Callable[[str], None]
    """Shows an instruction to the experimenter."""
    folder: Path
    """Folder of the study, which has its drives."""
    show: Callable[[dict[str, str] | None], None] = lambda _: None
    """Shows or plays a text, picture or sound (kind and source) on the participant's page; None ends it."""
    done: threading.Event = field(default_factory=threading.Event)
    ended: threading.Event = field(default_factory=threading.Event)

    def present(self, stimulus: Stimulus) -> None:
        """Present a stimulus; return when it is over."""
        if stimulus.kind == "drive":
            self.play(self.folder / stimulus.source, stimulus.share)
            return
        if stimulus.kind == "silence" and self.quiet_s:
            self.wait(self.quiet_s)
            return
        if stimulus.kind in ("text", "picture", "sound"):
            sound = stimulus.kind == "sound"
            self.show({"kind": stimulus.kind, "source": stimulus.source})
            self.ended.wait(sound_duration(self.folder / stimulus.source) if sound else stimulus.duration_s)
            self.show(None)
            return
        self.done.clear()
        self.tell("present nothing, and wait" if stimulus.kind == "silence" else f"present: {stimulus.source}")
        while not self.done.wait(0.1):
            if self.ended.is_set():
                return
        self.tell("")

    def silence(self) -> None:
        """Stop at once."""
        self.ended.set()
        self.stop()
