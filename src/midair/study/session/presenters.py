"""Who makes a stimulus felt: an array, an experimenter with an object in hand, or nobody."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event
from typing import Protocol

from midair.devices import ArrayDevice, ExposureClearance
from midair.errors import InputError, SilentFramesError
from midair.model import Medium
from midair.rig import play_cleared
from midair.study.design import Stimulus


class Presenter(Protocol):
    """What makes a stimulus felt: an array, or a person with an object in hand."""

    def present(self, stimulus: Stimulus) -> None:
        """Present it; return when it is over."""
        ...

    def silence(self) -> None:
        """End it at once; may come at any time, from any thread, and more than once."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimenterPresenter:
    """A person presents: told what to take up, who says when it is done. The one who presents cannot be blind.

    Attributes
    ----------
    tell : callable
        Shows a line to the experimenter only.
    done : callable
        Returns when the experimenter says that the stimulus was presented.
    """

    tell: Callable[[str], None]
    done: Callable[[], None]

    def present(self, stimulus: Stimulus) -> None:
        """Ask the experimenter to do it."""
        self.tell("wait, present nothing" if stimulus.kind == "silence" else f"present: {stimulus.source}")
        self.done()

    def silence(self) -> None:
        """Ask the experimenter to take the hand away."""
        self.tell("nothing is to touch the participant now")


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayPresenter:
    """An open array plays the drives; anything else is handed on to the experimenter.

    Attributes
    ----------
    array : ArrayDevice
        Open.
    admitted : callable
        From a stimulus to its drive, admitted on this array; asked before the first trial, see `check`.
    by_hand : Presenter
        For real objects.
    room : Medium, optional
        The air, where somebody stated it; the log of what was played has it.
    silence_s : float
        How long a stimulus of silence lasts, in s: as long as the others, or the end of the wait would tell.
    ended : Event
        Set when silence is ordered.
    """

    array: ArrayDevice
    admitted: Callable[[Stimulus], ExposureClearance]
    by_hand: Presenter
    room: Medium | None = None
    silence_s: float = 0.0
    ended: Event = field(default_factory=Event)

    def check(self, stimuli: tuple[Stimulus, ...]) -> None:
        """Admit every drive once, so that a file that is missing or too loud stops the session before it begins.

        Raises
        ------
        InputError
            If a drive is for another array, or exceeds the exposure profile.
        """
        for stimulus in stimuli:
            if stimulus.kind == "drive":
                try:
                    self.admitted(stimulus)
                except InputError as wrong:
                    raise type(wrong)(f"{stimulus.source}: {wrong}") from wrong

    def present(self, stimulus: Stimulus) -> None:
        """Play it, or have it presented; what is played is in the log.

        Raises
        ------
        SilentFramesError
            If the array was silent where it should have sounded, at the end or within.
        """
        self.ended.clear()
        if stimulus.kind == "silence":
            self.ended.wait(self.silence_s)
        elif stimulus.kind == "drive":
            admission = self.admitted(stimulus)
            share = "" if stimulus.share == 1 else f" at {stimulus.share:g} of its pressure"
            report = play_cleared(admission, self.array, source=stimulus.source + share, room=self.room)
            if report.gap:
                raise SilentFramesError(
                    f"array: expected every frame in time, {report.late} were late after {report.gap:.3f} s of "
                    "silence; close other programs"
                )
        elif stimulus.kind == "object":
            self.by_hand.present(stimulus)

    def silence(self) -> None:
        """Silence the array, then tell the experimenter."""
        self.ended.set()
        self.array.silence()
        self.by_hand.silence()


class Masking(Protocol):
    """Noise that hides what is to be heard of a stimulus."""

    def on(self) -> None:
        """Let it swell; return when it has."""
        ...

    def off(self) -> None:
        """Let it fade."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskedPresenter:
    """Another presenter, with noise in the headphones while a drive or a silence is presented (paper, 5.3).

    Silence has the same noise, or it would be told by the ear. Real objects are presented without.

    Attributes
    ----------
    inner : Presenter
        That presents.
    noise : Masking
        Open.
    """

    inner: Presenter
    noise: Masking

    def present(self, stimulus: Stimulus) -> None:
        """Present it under the noise."""
        if stimulus.kind == "object":
            self.inner.present(stimulus)
            return
        self.noise.on()
        try:
            self.inner.present(stimulus)
        finally:
            self.noise.off()

    def silence(self) -> None:
        """Silence the stimulus first, then the noise."""
        self.inner.silence()
        self.noise.off()


class SilentPresenter:
    """Presents nothing: for simulated participants, who ask it what they would have felt.

    Attributes
    ----------
    felt : tuple of str
        Names of the last two stimuli: those of a pair come one by one.
    """

    def __init__(self) -> None:
        self.felt: tuple[str, ...] = ()

    def present(self, stimulus: Stimulus) -> None:
        """Remember it."""
        self.felt = (*self.felt[-1:], stimulus.name)

    def silence(self) -> None:
        """Nothing to end."""
