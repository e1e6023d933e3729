"""Sound cards and audio interfaces through PortAudio; needs the extra `audio` and the library PortAudio.

Samples are fractions of full scale, -1 to 1. PortAudio reports that it lost samples, but not how many; their number
follows from the converter's clock.
"""

import atexit
import contextlib
import importlib
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.devices.sensors.sources import Chunk, Samples, SensorOptions, Stream, above_zero, opened
from midair.errors import DeviceError, UnknownDeviceError
from midair.model import RATE

sounddevice: Any = None
_reason = ""
try:
    sounddevice = importlib.import_module("sounddevice")
except OSError as _wrong:  # the library PortAudio is missing; the options of a name are checked without it
    _reason = str(_wrong)


def _need_library() -> None:
    if sounddevice is None:
        raise DeviceError(
            f"audio: expected the library PortAudio (Debian: apt-get install libportaudio2), got: {_reason}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Piece:
    """Samples of one callback: `taken` on PortAudio's clock, `arrived` on this computer's, `age` of the first frame."""

    samples: Samples
    taken: float
    arrived: float
    age: float
    overflow: bool


class _PortAudio:
    """State of the PortAudio library, one per process."""

    def __init__(self) -> None:
        self._keep_running = False

    def never_terminate(self) -> None:
        """Never terminate PortAudio: after the loss of a JACK server that would hang or abort the process."""
        self._keep_running = True
        atexit.unregister(sounddevice._exit_handler)

    def restart(self) -> None:
        """Restart PortAudio, which lists only the devices present when it started."""
        if not self._keep_running:
            with contextlib.suppress(sounddevice.PortAudioError):
                sounddevice._terminate()
            sounddevice._initialize()


_PORTAUDIO = _PortAudio()


class AudioSource:
    """Inputs of one audio device.

    `device` is part of its name or its number in `midair doctor`; empty for the default input. `channels` and `rate`
    are those of the device by default.
    """

    def __init__(self, device: str = "", *, channels: int | None = None, rate: float | None = None) -> None:
        _need_library()
        self._device, self._channels, self._rate_wanted = device, channels, rate
        self._pieces: queue.SimpleQueue[_Piece] = queue.SimpleQueue()
        self._last: _Piece | None = None
        self._stream: Any = None
        self._rate, self._frames, self._overflows = 1.0, 0, 0
        self._described: dict[str, str] = {}

    def open(self) -> Stream:
        """Find the device and open its inputs."""
        found = _find(self._device)
        channels = self._channels or int(found["max_input_channels"])
        self._rate = self._rate_wanted or float(found["default_samplerate"])
        try:
            self._stream = sounddevice.RawInputStream(
                samplerate=self._rate,
                blocksize=max(1, round(0.02 * self._rate)),
                device=int(found["index"]),
                channels=channels,
                dtype="float32",
                callback=self._store_block,
            )
        except (sounddevice.PortAudioError, ValueError) as wrong:
            raise DeviceError(
                f"audio: expected {channels} channels at {self._rate:g} Hz from {found['name']!r} (it has "
                f"{found['max_input_channels']}, usually at {found['default_samplerate']:g} Hz), got: {wrong}; "
                "state ?channels= and ?native="
            ) from wrong
        api: Any = sounddevice.query_hostapis(found["hostapi"])
        self._described = {"device": str(found["name"]), "driver": str(api["name"])}
        return Stream(channels=channels, rate=self._rate, full_scale=1.0, stored="f4")

    def start(self) -> None:
        """Start recording; frame 0 is the first one after this call."""
        stream = opened(self._stream, "audio")
        self._frames, self._pieces, self._last, self._overflows = 0, queue.SimpleQueue(), None, 0
        try:
            stream.start()
        except sounddevice.PortAudioError as wrong:
            raise DeviceError(
                f"audio: {self._described['device']!r} did not start: {wrong}; plug it in again"
            ) from wrong

    def pull(self, wait: float) -> Chunk | None:
        """Return the next block of PortAudio."""
        try:
            piece = self._pieces.get(timeout=wait)
        except queue.Empty:
            piece = None
        if piece is None:
            if opened(self._stream, "audio").active:
                return None
            if self._on_jack:
                _PORTAUDIO.never_terminate()
            raise DeviceError(f"audio: lost {self._described['device']!r}; plug it in and start again")
        self._frames += self._missing(piece)
        first, self._frames = self._frames, self._frames + len(piece.samples)
        self._last = piece
        return Chunk(
            samples=piece.samples, first=first, device_time=first / self._rate, host_time=piece.arrived - piece.age
        )

    def stop(self) -> None:
        """Stop recording; no effect if not started."""
        if self._stream is not None and self._stream.active:
            self._within_limit(self._stream.abort)

    def close(self) -> None:
        """Close the device."""
        stream, self._stream = self._stream, None
        if stream is not None:
            self._within_limit(stream.close)

    def describe(self) -> dict[str, str]:
        """Device, driver, and the number of reported losses."""
        return {**self._described, "losses reported by the driver": str(self._overflows)}

    @property
    def _on_jack(self) -> bool:
        return self._described["driver"].startswith("JACK")

    def _store_block(self, data: Any, frames: int, times: Any, status: Any) -> None:
        """Store a block; called in a thread of PortAudio, must not block."""
        # A copy, since PortAudio reuses its memory after this returns.
        samples = np.frombuffer(data, np.float32).reshape(frames, -1).copy()
        taken, age = float(times.inputBufferAdcTime), float(times.currentTime) - float(times.inputBufferAdcTime)
        if not 0 < age < 10:  # some drivers do not report it
            age = frames / self._rate
        self._pieces.put(
            _Piece(
                samples=samples, taken=taken, arrived=time.monotonic(), age=age, overflow=bool(status.input_overflow)
            )
        )

    def _missing(self, piece: "_Piece") -> int:
        """Number of frames between the last block and this one, by the converter's clock, if PortAudio reports a loss.

        JACK reports a loss whenever it was late, and its clock counts frames: with JACK the number may be 0.
        """
        if self._last is None or not piece.overflow:
            return 0
        self._overflows += 1
        since = piece.taken - self._last.taken - len(self._last.samples) / self._rate
        return max(0 if self._on_jack else 1, round(since * self._rate))

    def _within_limit(self, call: Callable[[], Any]) -> None:
        """Call with a time limit, since PortAudio waits forever for a JACK server that has ended."""

        def quietly() -> None:
            with contextlib.suppress(sounddevice.PortAudioError):
                call()

        thread = threading.Thread(target=quietly, daemon=True)
        thread.start()
        thread.join(2.0)
        if thread.is_alive():
            _PORTAUDIO.never_terminate()


def inputs() -> list[dict[str, Any]]:
    """Devices with inputs, as sounddevice describes them; DeviceError without the library PortAudio."""
    _need_library()
    return [dict(each) for each in sounddevice.query_devices() if each["max_input_channels"] > 0]


def _find(wanted: str) -> dict[str, Any]:
    """The one device with inputs of a number, or whose name and driver contain these words; empty for the default."""
    which = int(wanted) if wanted.isdecimal() else wanted or None
    try:
        try:
            return dict(sounddevice.query_devices(which, "input"))
        except (ValueError, sounddevice.PortAudioError):
            _PORTAUDIO.restart()
            return dict(sounddevice.query_devices(which, "input"))
    except (ValueError, sounddevice.PortAudioError) as wrong:
        got = str(wrong).partition("\n")[0]
        raise UnknownDeviceError(
            f"audio: expected one device with inputs for {wanted or 'the default'!r}, got: {got.rstrip(':')}; "
            f"name one of: {_names() or 'none found'}"
        ) from wrong


def _names() -> str:
    return ", ".join(f"{each['index']} {each['name']} ({each['max_input_channels']} channels)" for each in inputs())


@dataclass(frozen=True, kw_only=True)
class AudioSensor(SensorOptions):
    """Kind ``audio:DEVICE``."""

    package = "sounddevice"
    has_default = True
    rate: float | None = above_zero(RATE, "Frame rate, to which the samples are filtered and decimated.", "Hz")
    channels: int | None = above_zero(None, "Number of inputs; by default all.")
    native: float | None = above_zero(None, "Rate of the converter; by default the device's.", "Hz")

    def source(self, place: str) -> AudioSource:
        """Inputs of a device; of the default one if the place is empty."""
        return AudioSource(place, channels=self.channels, rate=self.native)

    @classmethod
    def available(cls) -> str:
        """Devices with inputs."""
        return f"inputs: {_names() or 'none'}"
