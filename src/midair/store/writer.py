"""Recordings while they are made: what was said a quarter of a second ago survives the death of the program."""

import os
import shutil
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from midair.errors import FileError
from midair.model import Calibration, Provenance, Recording, SensorGrid, Unit
from midair.model.arrays import frozen_array, positive
from midair.store.axes import sensor_values
from midair.store.calibration_file import write_calibration
from midair.store.files import reason, writable_path
from midair.store.hdf5 import LAYOUT, signature, stored_dataset, write_group

if TYPE_CHECKING:
    import h5py


class RecordingWriter:
    """A recording's file that grows while the sensor speaks, and that others may read meanwhile (SWMR).

    Leaving the context closes the file in order, also on an error; killing the program loses at most what came in the
    last `interval`. It stands up to the death of the program, not of the computer: the bytes are with the operating
    system, which writes them to the disk in its own time.

    Parameters
    ----------
    path : str or PathLike
        To make; a file that is there is left alone.
    rate : float
        Frames per second, in Hz.
    sensor : SensorGrid
        The cells.
    unit : {"V", "count", "Pa"}
        Of the samples.
    provenance : Provenance
        Where the samples come from.
    calibration : Calibration, optional
        Of the sensor, kept in the same file.
    interval : float
        Longest time that a frame waits in memory, in s.
    reserve : int
        Bytes that stay free on the disk: a recording ends in order before the disk is full.

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
    ) -> None:
        self.path = writable_path(path)
        self.rate = positive(rate, "rate", "Hz")
        self.sensor = sensor
        self.unit: Unit = unit
        self.provenance = provenance
        self.calibration = calibration
        self.interval = positive(interval, "interval", "s")
        self.reserve = reserve
        self._frames = 0
        self._file: h5py.File | None = None
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._flushed = 0.0
        self._failure: Exception | None = None
        # A recording of one silent frame meets the unit and the sensor as every later block will.
        Recording(samples=np.zeros((1, *sensor.shape)), rate=self.rate, sensor=sensor, unit=unit)

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return self._frames

    def __enter__(self) -> Self:
        import h5py

        try:
            self._file = h5py.File(self.path, "x", libver=LAYOUT)
        except FileExistsError as wrong:
            raise FileError(f"{self.path}: a file is there already; record under another name") from wrong
        except OSError as wrong:
            raise FileError(f"{self.path}: cannot be written: {reason(wrong)}") from wrong
        write_group(self._file, "recording", self._start(), live=True)
        if self.calibration is not None:
            write_calibration(self._file.create_group("calibration"), self.calibration)
        self._file.swmr_mode = True
        self._flush()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, wrong: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def append(self, block: ArrayLike) -> None:
        """Add frames at the end.

        Parameters
        ----------
        block : array_like, shape (frame, row, column)
            In the unit of the recording.

        Raises
        ------
        ShapeError, NonFiniteError
            If the block does not fit; nothing of it is written.
        FileError
            If the file is closed, or the disk is full or refuses.
        """
        samples = frozen_array(block, "block", ("frame", *self.sensor.shape))
        with self._lock:
            file = self._opened()
            self._check_room()
            start, stop = self._frames, self._frames + len(samples)
            try:
                self._extend(stored_dataset(file, "time"), start, np.arange(start, stop) / self.rate)
                self._extend(stored_dataset(file, "samples"), start, samples)
            except (OSError, RuntimeError) as wrong:
                raise FileError(f"{self.path}: cannot be written: {reason(wrong)}") from wrong
            self._frames = stop
            self._flush_in_time()

    def close(self) -> None:
        """Write what is left, mark the recording as finished, and close it; once is enough, twice does no harm."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            if self._file is None:
                return
            file, self._file = self._file, None
            try:
                stored_dataset(file, "finished")[()] = 1
                file.close()
            except (OSError, RuntimeError) as wrong:
                raise FileError(f"{self.path}: cannot be closed in order: {reason(wrong)}") from wrong

    def _start(self) -> dict[str, Any]:
        return {
            **signature("recording", self.provenance),
            **sensor_values(self.sensor),
            "rate_hz": self.rate,
            "unit": self.unit,
            "time": np.zeros(0),
            "samples": np.zeros((0, *self.sensor.shape)),
            "finished": 0,
        }

    def _opened(self) -> "h5py.File":
        if self._failure is not None:
            raise FileError(f"{self.path}: cannot be written: {reason(self._failure)}") from self._failure
        if self._file is None:
            raise FileError(f"{self.path}: the recording is not open; use it in a with block")
        return self._file

    def _check_room(self) -> None:
        free = shutil.disk_usage(self.path.parent).free
        if free < self.reserve:
            raise FileError(
                f"{self.path}: expected {self.reserve / 1e6:.4g} MB free on the disk, got {free / 1e6:.4g} MB; "
                f"the {self._frames} frames so far are safe, make room and record on under another name"
            )

    def _extend(self, dataset: "h5py.Dataset", start: int, values: np.ndarray) -> None:
        dataset.resize(start + len(values), axis=0)
        dataset[start:] = values

    def _flush_in_time(self) -> None:
        """Flush now if the last time is long ago, else leave it to a timer: the next block may be late."""
        waited = time.monotonic() - self._flushed
        if waited >= self.interval:
            self._flush()
        elif self._timer is None:
            self._timer = threading.Timer(self.interval - waited, self._flush_later)
            self._timer.daemon = True
            self._timer.start()

    def _flush_later(self) -> None:
        with self._lock:
            try:
                self._flush()
            except (OSError, RuntimeError) as wrong:
                self._failure = wrong  # the next append says it

    def _flush(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._flushed = time.monotonic()
        if self._file is not None:
            # Times first: netCDF pads a variable that is shorter than its axis, and knows no longer ones.
            stored_dataset(self._file, "time").flush()
            stored_dataset(self._file, "samples").flush()
