"""Presenters of stimuli: an array, an experimenter with real objects, masking noise (paper, 5.3), or none."""

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event, Lock
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import (
    DeviceError,
    InputError,
    MissingExtraError,
    SilentFramesError,
    StoppedError,
    UnknownDeviceError,
)
from midair.rig import Cleared, Session
from midair.study.design.question import Stimulus
from midair.study.design.study_design import MaskingNoise
from midair.study.event_markers import EventMarkers


class Headphones:
    """Sound output with white noise; a context manager that is silent on exit.

    The samples are uniform, equal in both channels and new in every frame. `device` is the name of the sound output or
    part of it; "default" for the system's choice.
    """

    def __init__(self, noise: MaskingNoise, *, device: str = "default", seed: int | None = None) -> None:
        self.noise = noise
        self.rate = 0.0
        self.underflows = 0
        self._device = None if device == "default" else device
        self._rng = np.random.default_rng(seed)
        # Full scale is 1; the rms of a full-scale sine is 1/sqrt 2, of uniform noise its bound/sqrt 3.
        self._bound = 10 ** (noise.level_dbfs / 20) * np.sqrt(1.5)
        self._gain = 0.0
        self._target = 0.0
        self._lock = Lock()
        self._reached = Event()
        self._stream: Any = None

    def __enter__(self) -> Self:
        try:
            import sounddevice
        except ImportError as wrong:
            raise MissingExtraError("headphones: expected the extra audio; pip install 'midair[audio]'") from wrong
        except OSError as wrong:
            raise DeviceError("headphones: expected PortAudio; apt-get install libportaudio2") from wrong
        try:
            self._stream = sounddevice.OutputStream(
                device=self._device, channels=2, dtype="float32", callback=self._fill
            )
            self.rate = float(self._stream.samplerate)
            self._stream.start()
        except ValueError as wrong:
            raise UnknownDeviceError(
                f"headphones: {str(wrong)[:120]}; `python -m sounddevice` lists outputs"
            ) from wrong
        except sounddevice.PortAudioError as wrong:
            raise DeviceError(
                f"headphones: expected a sound output, got: {str(wrong)[:120]}; connect one, or choose the noise none"
            ) from wrong
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.off()
        finally:
            self._stream.close()

    def on(self) -> None:
        """Fade the noise in; return at its full level. Raises DeviceError if the sound card accepts no samples."""
        self._ramp_to(1.0)

    def off(self) -> None:
        """Fade the noise out; return when it is silent."""
        self._ramp_to(0.0)

    def _ramp_to(self, gain: float) -> None:
        with self._lock:
            self._reached.clear()
            self._target = gain
        if not self._reached.wait(self.noise.ramp_s + 2):
            raise DeviceError(
                "headphones: expected the sound card to accept samples, it accepted none for 2 s; check the output"
            )

    def _fill(self, out: NDArray[np.float32], frames: int, _time: Any, status: Any) -> None:
        """Callback of the sound card, in its own thread: fill the next frames."""
        self.underflows += bool(status)
        wanted = self._target
        step = 1 / (self.noise.ramp_s * self.rate)
        path = self._gain + np.sign(wanted - self._gain) * step * np.arange(1, frames + 1)
        low, high = sorted((self._gain, wanted))
        gain = np.clip(path, low, high) if wanted != self._gain else np.full(frames, wanted)
        out[:] = (gain * self._rng.uniform(-self._bound, self._bound, frames))[:, None]
        self._gain = float(gain[-1])
        with self._lock:
            # The target may have changed in the meantime.
            if self._gain == self._target:
                self._reached.set()


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
    """Plays drives in a session on an open array and passes real objects to the experimenter."""

    session: Session
    cleared: Callable[[Stimulus], Cleared]
    """Returns the drive of a stimulus with its clearance by this session."""
    by_hand: Presenter
    """Presenter of real objects and texts."""
    silence_s: float = 0.0
    """Duration of a silent stimulus, in s; equal to that of the drives, so that it does not reveal the silence."""
    ended: Event = field(default_factory=Event)
    """Set when silence is requested."""

    def check(self, stimuli: tuple[Stimulus, ...]) -> None:
        """Check the exposure of every drive before the session.

        Raises InputError if a drive belongs to another array, or exceeds the exposure profile.
        """
        for stimulus in stimuli:
            if stimulus.kind == "drive":
                try:
                    self.cleared(stimulus)
                except InputError as wrong:
                    raise type(wrong)(f"{stimulus.source}: {wrong}") from wrong

    def present(self, stimulus: Stimulus) -> None:
        """Present a stimulus and log played drives; raises SilentFramesError if late frames caused silence."""
        self.ended.clear()
        if stimulus.kind == "silence":
            self.ended.wait(self.silence_s)
        elif stimulus.kind == "drive":
            share = "" if stimulus.share == 1 else f" at {stimulus.share:g} of its pressure"
            played = self.session.play(self.cleared(stimulus), source=stimulus.source + share, progress=self._go_on)
            if (report := played.report) is not None and report.gap:
                raise SilentFramesError(
                    f"array: expected every frame in time, got {report.late} late frames and {report.gap:.3f} s of "
                    "silence; close other programs"
                )
        else:
            self.by_hand.present(stimulus)

    def _go_on(self, done: int, total: int) -> None:
        """Raise StoppedError if silence was requested."""
        if self.ended.is_set():
            raise StoppedError(f"{self.session.rig.array.name}: stopped after {done} of {total} frames")

    def silence(self) -> None:
        """Silence the array, then instruct the experimenter."""
        self.ended.set()
        self.session.rig.array.silence()
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


class SilentPresenter(Presenter):
    """Presents nothing and stores the names of the last two stimuli in `felt`, for simulated participants.

    The members of a pair are presented one by one.
    """

    def __init__(self) -> None:
        self.felt: tuple[str, ...] = ()

    def present(self, stimulus: Stimulus) -> None:
        """Store the name of the stimulus."""
        self.felt = (*self.felt[-1:], stimulus.name)
