"""Presenters of stimuli: an array, an experimenter with real objects, masking noise, or none."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event
from typing import Protocol

from midair.devices import ArrayDevice, ExposureClearance, PlayReport
from midair.errors import InputError, SilentFramesError, StoppedError
from midair.model import Medium, Progress
from midair.rig import play_cleared
from midair.study.design import Stimulus
from midair.study.event_markers import EventMarkers
from midair.study.headphones import Headphones


class Presenter(Protocol):
    """Presents stimuli, such as an array or an experimenter."""

    def present(self, stimulus: Stimulus) -> None:
        """Present a stimulus; return when it has ended."""

    def silence(self) -> None:
        """End the presentation at once; callable at any time, from any thread, and repeatedly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimenterPresenter:
    """Presentation by an experimenter, who is not blind to the condition."""

    tell: Callable[[str], None]
    """Shows a line to the experimenter only."""
    done: Callable[[], object]
    """Returns when the experimenter confirms the presentation."""

    def present(self, stimulus: Stimulus) -> None:
        """Show the instruction and wait for the confirmation."""
        self.tell("wait, present nothing" if stimulus.kind == "silence" else f"present: {stimulus.source}")
        self.done()

    def silence(self) -> None:
        """Instruct the experimenter to remove the object."""
        self.tell("remove the object: nothing may touch the participant now")


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayPresenter:
    """Plays drives on an open array and passes real objects to the experimenter."""

    array: ArrayDevice
    admitted: Callable[[Stimulus], ExposureClearance]
    """Returns the drive of a stimulus with its exposure clearance for this array."""
    by_hand: Presenter
    """Presenter of real objects and texts."""
    room: Medium | None = None
    """Air for the log of played drives; None if unknown."""
    silence_s: float = 0.0
    """Duration of a silent stimulus, in s; equal to that of the drives, so that it does not reveal the silence."""
    followed: Callable[[Stimulus, str, Progress], PlayReport] | None = None
    """Plays a stimulus, named so in the log, while it follows a palm; None to play without."""
    ended: Event = field(default_factory=Event)
    """Set when silence is requested."""

    def check(self, stimuli: tuple[Stimulus, ...]) -> None:
        """Check the exposure of every drive before the session.

        Raises InputError if a drive belongs to another array, or exceeds the exposure profile.
        """
        for stimulus in stimuli:
            if stimulus.kind == "drive":
                try:
                    self.admitted(stimulus)
                except InputError as wrong:
                    raise type(wrong)(f"{stimulus.source}: {wrong}") from wrong

    def present(self, stimulus: Stimulus) -> None:
        """Present a stimulus and log played drives; raises SilentFramesError if late frames caused silence."""
        self.ended.clear()
        if stimulus.kind == "silence":
            self.ended.wait(self.silence_s)
        elif stimulus.kind == "drive":
            share = "" if stimulus.share == 1 else f" at {stimulus.share:g} of its pressure"
            if self.followed is not None:
                report = self.followed(stimulus, stimulus.source + share, self._go_on)
            else:
                admission = self.admitted(stimulus)
                report = play_cleared(admission, self.array, source=stimulus.source + share, room=self.room)
            if report.gap:
                raise SilentFramesError(
                    f"array: expected every frame in time, got {report.late} late frames and {report.gap:.3f} s of "
                    "silence; close other programs"
                )
        else:
            self.by_hand.present(stimulus)

    def _go_on(self, done: int, total: int) -> None:
        """Raise StoppedError if silence was requested."""
        if self.ended.is_set():
            raise StoppedError(f"{self.array.name}: stopped after {done} of {total} frames")

    def silence(self) -> None:
        """Silence the array, then instruct the experimenter."""
        self.ended.set()
        self.array.silence()
        self.by_hand.silence()


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskedPresenter:
    """Presenter with masking noise in the headphones during drives and silent stimuli (paper, 5.3).

    Silent stimuli have the same noise, so that participants cannot hear the difference. Other stimuli have none.
    """

    inner: Presenter
    """Presents the stimuli."""
    noise: Headphones
    """An open source of noise."""

    def present(self, stimulus: Stimulus) -> None:
        """Present a stimulus during the noise."""
        if stimulus.kind not in ("drive", "silence"):
            self.inner.present(stimulus)
            return
        self.noise.on()
        try:
            self.inner.present(stimulus)
        finally:
            self.noise.off()

    def silence(self) -> None:
        """Silence the stimulus, then the noise."""
        self.inner.silence()
        self.noise.off()


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedPresenter:
    """Presenter with an event marker directly before each stimulus, after the fade-in of masking noise."""

    inner: Presenter
    """Presents the stimuli."""
    markers: EventMarkers
    """Open outputs; the session has sent the marker of the trial."""

    def present(self, stimulus: Stimulus) -> None:
        """Send the marker, then present the stimulus."""
        self.markers.send("stimulus", code=stimulus.code)
        self.inner.present(stimulus)

    def silence(self) -> None:
        """Silence the stimulus."""
        self.inner.silence()


@dataclass(frozen=True, slots=True, kw_only=True)
class TextPresenter:
    """Presenter that shows texts itself."""

    inner: Presenter
    """Presents all other stimuli."""
    show: Callable[[str], None]
    """Shows a text to the participant; an empty one removes it."""
    ended: Event = field(default_factory=Event)
    """Set when silence is requested."""

    def present(self, stimulus: Stimulus) -> None:
        """Show a text for its duration, or present another stimulus."""
        if stimulus.kind != "text":
            self.inner.present(stimulus)
            return
        self.ended.clear()
        self.show(stimulus.source)
        self.ended.wait(stimulus.duration_s)
        self.show("")

    def silence(self) -> None:
        """Remove the text, and silence the stimulus."""
        self.ended.set()
        self.inner.silence()


class SilentPresenter:
    """Presents nothing and stores the names of the last two stimuli in `felt`, for simulated participants.

    The members of a pair are presented one by one.
    """

    def __init__(self) -> None:
        self.felt: tuple[str, ...] = ()

    def present(self, stimulus: Stimulus) -> None:
        """Store the name of the stimulus."""
        self.felt = (*self.felt[-1:], stimulus.name)

    def silence(self) -> None:
        """Do nothing."""
