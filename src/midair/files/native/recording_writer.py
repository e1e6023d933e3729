"""Write recordings while they run; at most the last quarter of a second is lost if the program is killed."""

import importlib
import os
import shutil
import threading
import time
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from midair.errors import FileError, InputError
from midair.files.atomic import note_written_file, reason, writable_path
from midair.files.native.calibration_file import write_calibration
from midair.files.native.checksums import extend_checksums
from midair.files.native.hdf5 import LAYOUT, fixed_text, signature, stored_dataset, write_group
from midair.files.native.live_file import LiveFile
from midair.files.native.recording_file import KINDS, PLAYED, event_values, played_values, stage_values
from midair.files.native.schema import sensor_values, single
from midair.model import Calibration, Event, Provenance, Recording, SensorGrid, StageStamp, TransducerArray, Unit
from midair.streaming import Stored
from midair.validation import frozen_array, positive

if TYPE_CHECKING:
    import h5py


class RecordingWriter:
    """Write a growing recording file, which other programs may read meanwhile (SWMR).

    Leaving the context closes the file, also after an error. If the program is killed or the disk fails, at most the
    frames of the last `interval` are lost; the error states how many frames are safe. This does not hold for a crash of
    the computer, because the operating system may hold data back until the file is closed. No other program of midair
    can replace or remove the file meanwhile.

    `path` is a new file; `rate`, `sensor`, `unit`, `provenance` and `calibration` are as in `Recording` and
    `OpenedTake`. `interval` is the longest time in s, and the equivalent number of frames, that may be buffered in
    memory, `reserve` the bytes to leave free on the disk: the recording stops before the disk is full. With `expected`
    frames an error is raised at the start if the disk has less space. `staged` stores positions of a motion stage too;
    with `stored` "f4" a block that float32 cannot hold raises an error; with an `array` that plays meanwhile every
    frame needs `played` values.

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
        interval: float = 0.25,
        reserve: int = 2**24,
        expected: int = 0,
        staged: bool = False,
        stored: Stored = "f8",
        array: TransducerArray | None = None,
        played_each: int = 1,
    ) -> None:
        self.path = writable_path(path)
        self.rate = positive(rate, "rate", "Hz")
        self.sensor = sensor
        self.unit: Unit = unit
        self.provenance = provenance
        self.calibration = calibration
        self.interval = positive(interval, "interval", "s")
        self.reserve, self.expected, self.staged = reserve, expected, staged
        self.stored: Stored = stored
        self.array, self.played_each = array, played_each
        self.frames = self._safe = 0
        """`frames`: number of frames so far."""
        # Rows of events and of stage positions: all, and those flushed.
        self._rows = {"event": 0, "stage": 0}
        self._safe_rows = dict(self._rows)
        self._live: LiveFile | None = None
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._flushed = 0.0
        self._failure: Exception | None = None
        self._raised = False
        # Raises an error for a wrong unit or sensor before the file is created.
        Recording(samples=np.zeros((1, *sensor.shape)), rate=self.rate, sensor=sensor, unit=unit)

    def __enter__(self) -> Self:
        self._check_room((np.dtype(self.stored).itemsize * self.sensor.count + 8) * self.expected)
        import h5py

        image = BytesIO()
        start = {
            **signature("recording", self.provenance),
            **sensor_values(self.sensor),
            "rate_hz": self.rate,
            "unit": self.unit,
            "time": np.zeros(0),
            "samples": np.zeros((0, *self.sensor.shape), self.stored),
            "finished": 0,
            **event_values(()),
            **(stage_values(()) if self.staged else {}),
        }
        with h5py.File(image, "w", libver=LAYOUT) as file:
            write_group(file, "recording", start, live=True)
            stored_dataset(file, "event_kind").attrs["flag_values"] = np.arange(len(KINDS), dtype="i1")
            stored_dataset(file, "event_kind").attrs["flag_meanings"] = fixed_text(" ".join(KINDS))
            if self.calibration is not None:
                write_calibration(file.create_group("calibration"), self.calibration)
            if self.array is not None:
                begun = played_values(self.array, self.played_each * self.rate, self.provenance)
                write_group(file.create_group("played"), "played", begun, live=True)
        self._live = LiveFile(self.path, image.getvalue())
        return self

    def __exit__(self, _: object, wrong: BaseException | None, __: object) -> None:
        self.close()
        if wrong is not None and self.frames == 0:
            self.path.unlink(missing_ok=True)

    @staticmethod
    def warm_up() -> None:
        """Load the libraries for writing, so that the first frame is not delayed."""
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
        if (self.array is None) != (played is None):
            which = "without" if self.array is None else "with"
            raise FileError(f"{self.path}: expected frames {which} the values played")
        with self._lock:
            file = self._opened()
            self._check_room()
            start, stop = self.frames, self.frames + len(samples)
            with self._disk_errors():
                self._extend(stored_dataset(file, "time"), start, np.arange(start, stop) / self.rate)
                self._extend(stored_dataset(file, "samples"), start, samples)
                if played is not None:
                    each = self.played_each
                    times = np.arange(each * start, each * stop) / (each * self.rate)
                    for name, values in {"time": times, **played}.items():
                        self._extend(stored_dataset(file, f"played/{name}"), each * start, values)
                self.frames = stop
                # Otherwise a timer, as the next block may be late.
                waited = time.monotonic() - self._flushed
                if waited >= self.interval or self.frames - self._safe >= self.interval * self.rate:
                    self._flush()
                elif self._timer is None:
                    self._timer = threading.Timer(self.interval - waited, self._flush_later)
                    self._timer.daemon = True
                    self._timer.start()

    def note(self, events: Iterable[Event]) -> None:
        """Store events, also of future frames; they are flushed with the next frames, before these."""
        self._add("event", event_values(tuple(events)))

    def stamp(self, stamps: Iterable[StageStamp]) -> None:
        """Store stage positions with times from frame 0 on; flushed as in `note`."""
        if not self.staged:
            raise FileError(f"{self.path}: expected a recording with a stage; create it with staged=True")
        self._add("stage", stage_values(tuple(stamps)))

    def _add(self, axis: str, values: dict[str, Any]) -> None:
        with self._lock:
            file = self._opened()
            first, rows = self._rows[axis], len(values[axis])
            with self._disk_errors():
                for name, column in (values | {axis: np.arange(first, first + rows)}).items() if rows else ():
                    self._extend(stored_dataset(file, name), first, column)
                self._rows[axis] += rows

    def close(self) -> None:
        """Write buffered frames, mark the recording as finished, and close it; further calls do nothing.

        If the disk fails, FileError and `frames` state how many frames are safe.
        """
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            if self._live is None:
                return
            live, self._live = self._live, None
            try:
                # Rows of an interrupted append or note; all datasets along an axis get equal length.
                for name, length in self._lengths().items():
                    if len(stored_dataset(live.file, name)) != length:
                        stored_dataset(live.file, name).resize(length, axis=0)
                self._add_checksums(live.file, last=True)
                stored_dataset(live.file, "finished")[()] = 1
                live.close()
                if self.frames:
                    note_written_file(self.path)
            except (OSError, RuntimeError) as wrong:
                # After an earlier failure the file has its last commit; closing was only an attempt.
                if self._failure is None:
                    self._record_failure(wrong)
            if self._failure is not None and not self._raised:
                raise self._disk_error() from self._failure

    def _opened(self) -> "h5py.File":
        if self._failure is not None:
            self._raised = True
            raise self._disk_error() from self._failure
        if self._live is None:
            raise FileError(f"{self.path}: the recording is not open; use it in a with block")
        return self._live.file

    def _check_room(self, more: int = 0) -> None:
        free = shutil.disk_usage(self.path.parent).free
        if free < self.reserve + more:
            far = f"the {self.frames} frames so far are safe, free some space and continue under another name"
            near = "free some space, record for a shorter time, or use another disk"
            raise FileError(
                f"{self.path}: expected {(self.reserve + more) / 1e6:.4g} MB free on the disk, got {free / 1e6:.4g} "
                f"MB; {near if self._live is None else far}"
            )

    @contextmanager
    def _disk_errors(self) -> Generator[None]:
        """End the recording after a disk error; the file keeps its last commit."""
        try:
            yield
        except (OSError, RuntimeError) as wrong:
            self._record_failure(wrong)
            self._raised = True
            raise self._disk_error() from wrong

    def _record_failure(self, wrong: Exception) -> None:
        self._failure, self.frames, self._rows = wrong, self._safe, dict(self._safe_rows)

    def _disk_error(self) -> FileError:
        why = "" if self._failure is None else reason(self._failure)
        return FileError(f"{self.path}: cannot be written: {why}; the {self._safe} frames so far are safe")

    def _extend(self, dataset: "h5py.Dataset", start: int, values: np.ndarray) -> None:
        dataset.resize(start + len(values), axis=0)
        dataset[start:] = values

    def _add_checksums(self, file: "h5py.File", *, last: bool = False) -> None:
        for name, length in self._lengths().items():
            extend_checksums(stored_dataset(file, name), length, last=last)

    def _lengths(self) -> dict[str, int]:
        """Number of complete rows of each dataset that grows."""
        lengths = dict.fromkeys(("time", "samples"), self.frames)
        names = (f"played/{name}" for name in PLAYED) if self.array is not None else ()
        lengths |= dict.fromkeys(names, self.played_each * self.frames)
        lengths |= dict.fromkeys(event_values(()), self._rows["event"])
        return lengths | dict.fromkeys(stage_values(()) if self.staged else (), self._rows["stage"])

    def _flush_later(self) -> None:
        with self._lock:
            try:
                self._flush()
            except (OSError, RuntimeError) as wrong:
                self._record_failure(wrong)  # the next append raises it

    def _flush(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._flushed = time.monotonic()
        if self._live is not None and self._failure is None:
            self._add_checksums(self._live.file)
            self._live.commit()
            self._safe, self._safe_rows = self.frames, dict(self._rows)
