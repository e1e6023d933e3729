"""Write recordings while they run; a program that is killed loses no frame that it has appended."""

import importlib
import json
import os
import shutil
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from io import BufferedRandom, FileIO
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from rich.filesize import decimal

from midair.errors import FileError, InputError
from midair.files.atomic import lock_recording, reason, writable_path
from midair.files.native.raw_recording import FRAMES, MAGIC, TEXT, convert, frame_type, record
from midair.files.native.schema import single, stored_values
from midair.model import Calibration, Event, Provenance, Recording, SensorGrid, StageStamp, TransducerArray, Unit
from midair.streaming import Stored
from midair.validation import frozen_array, positive


class RecordingWriter:
    """Append a recording to a raw file, which becomes HDF5 when the context is left, also after an error.

    If the program is killed, the frames that it appended are kept; if the computer stops, at most the last `interval`
    and block are lost. If the disk fails, the error states how many frames are safe. `open_take` reads what is left.
    No other program of midair can replace or remove the file meanwhile.

    `path` is a new file; `rate`, `sensor`, `unit`, `provenance` and `calibration` are as in `Recording` and
    `OpenedTake`. `interval` is the time in s after which written frames are flushed to the disk, `reserve` the bytes to
    leave free on it besides the HDF5 file: the recording stops before the disk is full. With `expected` frames an error
    is raised at the start if the disk has less space. With `stored` "f4" a block that float32 cannot hold raises an
    error; with an `array` that plays meanwhile every frame needs `played` values.

    Examples
    --------
    >>> with RecordingWriter("towel.h5", rate=1000, sensor=sensor, unit="V", provenance=provenance) as writer:
    ...     writer.append(block)
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        rate: float,
        sensor: SensorGrid,
        unit: Unit,
        provenance: Provenance,
        calibration: Calibration | None = None,
        interval: float = 0.2,
        reserve: int = 2**24,
        expected: int = 0,
        stored: Stored = "f8",
        array: TransducerArray | None = None,
        played_each: int = 1,
    ) -> None:
        self.path = writable_path(path)
        self.rate = positive(rate, "rate", "Hz")
        self.sensor = sensor
        self.interval = positive(interval, "interval", "s")
        self.reserve, self.expected = reserve, expected
        self.stored: Stored = stored
        self.frames = 0
        """Number of frames so far."""
        known = SimpleNamespace(rate=self.rate, sensor=sensor, unit=unit, array=array, provenance=provenance)
        self._header: dict[str, Any] = {
            "stored": stored,
            "recording": stored_values("recording", known),
            "calibration": None if calibration is None else stored_values("calibration", calibration),
            "played": None if array is None else stored_values("played", known),
            "played_each": played_each,
        }
        self._type = frame_type(self._header)
        self._file: FileIO | None = None
        self._size, self._synced = 0, 0.0
        self._failed = False
        # Raises an error for a wrong unit or sensor before the file is created.
        Recording(samples=np.zeros((1, *sensor.shape)), rate=self.rate, sensor=sensor, unit=unit)

    def __enter__(self) -> Self:
        self._check_room((2 * self._type.itemsize + 8) * self.expected)
        try:
            self._file = FileIO(self.path, "x+")
        except FileExistsError as wrong:
            raise FileError(f"{self.path}: the file exists already; record under another name") from wrong
        except OSError as wrong:
            raise FileError(f"{self.path}: cannot be written: {reason(wrong)}") from wrong
        try:
            lock_recording(self._file.fileno(), self.path)
            header = json.dumps(self._header, default=lambda array: array.tolist())
            self._write(MAGIC + record(TEXT, header.encode()))
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @staticmethod
    def warm_up() -> None:
        """Load the library that writes HDF5, so that the end of a recording does not wait for it."""
        importlib.import_module("h5py")

    def append(self, block: ArrayLike, played: Mapping[str, np.ndarray] | None = None) -> None:
        """Append frames in the unit of the recording, shape (frame, row, column).

        With `array`, `played` holds ``phase_steps``, ``intensity``, ``instant`` and ``state`` of these frames, or of
        `played_each` for each of them, as in `PlayedTouch`. An invalid block raises InputError and nothing is written.
        Raises FileError if the file is closed, or the disk is full or fails.
        """
        samples = frozen_array(block, "block", ("frame", *self.sensor.shape))
        if self.stored == "f4" and single(samples) is samples:
            raise InputError(
                f'{self.path}: expected samples that float32 holds, got others; write them with stored="f8"'
            )
        if (self._header["played"] is None) != (played is None):
            which = "without" if self._header["played"] is None else "with"
            raise FileError(f"{self.path}: expected frames {which} the values played")
        frames = np.empty(len(samples), self._type)
        for name, values in {"samples": samples, **(played or {})}.items():
            frames[name] = values.reshape(frames[name].shape)
        self._check_room()
        self._write(record(FRAMES, frames.tobytes()))
        self.frames += len(samples)

    def note(self, events: Iterable[Event]) -> None:
        """Store events, also of future frames."""
        self._add("events", [asdict(event) for event in events])

    def stamp(self, stamps: Iterable[StageStamp]) -> None:
        """Store stage positions with times from frame 0 on."""
        self._add("stamps", [asdict(stamp) for stamp in stamps])

    def close(self) -> None:
        """Convert the recording to HDF5; further calls do nothing.

        A file without frames is removed. If the disk fails, FileError states how many frames are safe.
        """
        if self._file is None:
            return
        file, self._file = self._file, None
        if not self.frames:
            file.close()
            self.path.unlink(missing_ok=True)
            return
        try:
            convert(self.path, BufferedRandom(file))
        except (OSError, FileError) as wrong:
            # Otherwise an error with the number of safe frames has been raised already.
            if not self._failed:
                raise FileError(f"{wrong}; its {self.frames} frames are safe, midair repair converts them") from wrong

    def _add(self, name: str, rows: list[Any]) -> None:
        if rows:
            self._write(record(TEXT, json.dumps({name: rows}).encode()))

    def _check_room(self, more: int = 0) -> None:
        free, needed = shutil.disk_usage(self.path.parent).free, self.reserve + self._size + more
        if free < needed:
            self._failed = True
            far = f"the {self.frames} frames so far are safe, free some space and continue under another name"
            near = "free some space, record for a shorter time, or use another disk"
            sizes = f"needs {decimal(needed)} on the disk, {decimal(free)} are free"
            raise FileError(f"{self.path}: {sizes}; {near if self._file is None else far}")

    def _write(self, data: bytes) -> None:
        """Append records, and flush them to the disk after each `interval`."""
        if self._file is None:
            raise FileError(f"{self.path}: the recording is not open; use it in a with block")
        if self._failed:
            raise FileError(
                f"{self.path}: the recording ended with a disk error; the {self.frames} frames so far are safe"
            )
        try:
            # Overwrite the part of a record that an interrupt left.
            self._file.seek(self._size)
            rest = memoryview(data)
            while rest:
                rest = rest[os.write(self._file.fileno(), rest) :]
            if time.monotonic() - self._synced >= self.interval:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as wrong:
            self._failed = True
            raise FileError(
                f"{self.path}: cannot be written: {reason(wrong)}; the {self.frames} frames so far are safe"
            ) from wrong
        self._size += len(data)
