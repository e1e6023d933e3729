"""Presenters of stimuli: an array, a screen and an experimenter, with masking noise (paper, 5.3); or none."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import DeviceError, UnknownDeviceError
from midair.registry import load_object
from midair.study.design.question import Stimulus
from midair.study.design.study_design import MaskingNoise
from midair.study.drives import sound_duration


class Headphones:
    """Sound output with white noise; a context manager that is silent on exit.

    The samples are uniform, equal in both channels and new in every frame. `device` is the name of the sound output or
    part of it; "default" for the system's choice.
    """

    def __init__(self, noise: MaskingNoise, *, device: str = "default", seed: int | None = None) -> None:
        self.noise = noise
        self.rate = 0.0
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
        sounddevice = load_object("headphones", "sounddevice [audio]")
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

    def _fill(self, out: NDArray[np.float32], frames: int, _time: Any, _status: Any) -> None:
        """Callback of the sound card, in its own thread: fill the next frames."""
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

    def present(self, stimulus: Stimulus, begins: Callable[[], object] = bool) -> None:
        """Present a stimulus and return when it has ended; call `begins` directly before it."""

    def silence(self) -> None:
        """End the presentation at once; callable at any time, from any thread, and repeatedly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StimulusPresenter:
    """Plays drives, shows texts, pictures and sounds, and lets an experimenter, who is not blind, present the rest."""

    tell: Callable[[str], object]
    """Shows a line to the experimenter only."""
    done: Callable[[], object]
    """Returns when the experimenter confirms the presentation."""
    show: Callable[[Stimulus | None], object] = bool
    """Shows or plays a text, picture or sound to the participant; None ends it."""
    play: Callable[[str, float], object] | None = None
    """Plays the drive of a source at a share of its pressure; None if the experimenter presents drives."""
    wait: Callable[[float], object] | None = None
    """Presents silence for some seconds; None if the experimenter presents it."""
    silence_s: float = 0.0
    """Duration of a silent stimulus, in s; equal to that of the drives, so that it does not reveal the silence."""
    stop: Callable[[], object] = bool
    """Silences the array at once, from any thread."""
    noise: Headphones | None = None
    """An open source of noise during drives and silences, whose difference is else heard (paper, 5.3)."""
    folder: Path = Path()
    """Folder of the sounds."""
    ended: Event = field(default_factory=Event)
    """Set when silence is requested."""

    def present(self, stimulus: Stimulus, begins: Callable[[], object] = bool) -> None:
        """Present a stimulus; return when it is over."""
        if self.noise is None or stimulus.kind not in ("drive", "silence"):
            return self._present(stimulus, begins)
        self.noise.on()
        try:
            return self._present(stimulus, begins)
        finally:
            self.noise.off()

    def _present(self, stimulus: Stimulus, begins: Callable[[], object]) -> None:
        begins()
        if stimulus.kind == "drive" and self.play is not None:
            self.play(stimulus.source, stimulus.share)
        elif stimulus.kind == "silence" and self.wait is not None:
            self.wait(self.silence_s)
        elif stimulus.kind in ("text", "picture", "sound"):
            sound = stimulus.kind == "sound"
            self.show(stimulus)
            self.ended.wait(sound_duration(self.folder / stimulus.source) if sound else stimulus.duration_s)
            self.show(None)
        else:
            self.tell("wait, present nothing" if stimulus.kind == "silence" else f"present: {stimulus.source}")
            self.done()

    def silence(self) -> None:
        """Silence the array and the noise, and end what is shown."""
        self.ended.set()
        self.stop()
        if self.noise is not None:
            self.noise.off()


class SilentPresenter(Presenter):
    """Presents nothing and stores the names of the last two stimuli in `felt`, for simulated participants.

    The members of a pair are presented one by one.
    """

    def __init__(self) -> None:
        self.felt: tuple[str, ...] = ()

    def present(self, stimulus: Stimulus, begins: Callable[[], object] = bool) -> None:
        """Store the name of the stimulus."""
        begins()
        self.felt = (*self.felt[-1:], stimulus.name)
