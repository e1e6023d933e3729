"""Masking noise in the headphones, so that participants do not hear the array (paper, 5.3)."""

from threading import Event, Lock
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import DeviceError, MissingExtraError, UnknownDeviceError
from midair.study.design import MaskingNoise


class Headphones:
    """Sound output with white noise; a context manager that is silent on exit.

    The samples are uniform, equal in all channels and new in every frame. `device` is the name of the sound output or
    part of it; "default" for the system's choice.
    """

    def __init__(
        self, noise: MaskingNoise, *, device: str = "default", channels: int = 2, seed: int | None = None
    ) -> None:
        self.noise = noise
        self.rate = 0.0
        self.underflows = 0
        self._device = None if device == "default" else device
        self._channels = channels
        self._rng = np.random.default_rng(seed)
        # Full scale is 1; the rms of a full-scale sine is 1/sqrt 2, of uniform noise its bound/sqrt 3.
        self._bound = 10 ** (noise.level_dbfs / 20) * np.sqrt(1.5)
        self._gain = 0.0
        self._target = 0.0
        self._lock = Lock()
        self._reached = Event()
        self._stream: Any = None

    def __enter__(self) -> Self:
        sounddevice = _sounddevice()
        try:
            self._stream = sounddevice.OutputStream(
                device=self._device, channels=self._channels, dtype="float32", callback=self._fill
            )
            self.rate = float(self._stream.samplerate)
            self._stream.start()
        except ValueError as wrong:
            raise UnknownDeviceError(
                f"headphones: {str(wrong)[:120]}; `python -m sounddevice` lists outputs"
            ) from wrong
        except sounddevice.PortAudioError as wrong:
            raise DeviceError(
                f"headphones: expected a sound output, got: {str(wrong)[:120]}; connect one, or --noise none"
            ) from wrong
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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


def _sounddevice() -> Any:
    try:
        import sounddevice
    except ImportError as wrong:
        raise MissingExtraError("headphones: expected the extra audio; pip install 'midair[audio]'") from wrong
    except OSError as wrong:
        raise DeviceError("headphones: expected PortAudio; apt-get install libportaudio2") from wrong
    return sounddevice
