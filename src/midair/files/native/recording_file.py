"""Recordings, `name.h5`: samples, calibration, provenance, calibrated pressure and live touch.

Its events are lost frames, clipped or constant channels, and clock drift. A running recording stores them and the
positions of a motion stage as rows along an axis of their own, because attributes cannot change while other programs
read. Readers return them as the steps "events" and "stage" of the provenance, so that copies and later stages keep
them.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from midair.errors import BrokenFileError, MismatchError
from midair.files.native.calibration_file import read_calibration, write_calibration
from midair.files.native.checksums import Ranges
from midair.files.native.hdf5 import (
    check_kind,
    finite,
    new_file,
    open_file,
    read_group,
    signature,
    stored_dataset,
    stored_group,
    write_group,
)
from midair.files.native.hdf5_recovery import is_unclosed
from midair.files.native.provenance_json import from_json
from midair.files.native.schema import (
    array_from,
    array_values,
    check_time,
    sensor_from,
    sensor_values,
    single,
    time_values,
)
from midair.files.opened_take import Format, FormatLoss, ImportOptions, OpenedTake
from midair.model import (
    Calibration,
    Event,
    EventKind,
    PlayedTouch,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    Setting,
    StageStamp,
    TransducerArray,
    Unit,
    speed_of,
)
from midair.streaming import LazyFrames, block_ranges

if TYPE_CHECKING:
    import h5py


LISTED = 1000
"""Maximum number of events per kind that are listed in the provenance; the totals count all."""


KINDS: tuple[EventKind, ...] = get_args(EventKind)
"""The number in the file is the index in this tuple."""


def event_values(events: Iterable[Event]) -> dict[str, Any]:
    """Stored values of events."""
    rows = tuple(events)
    whole = {f"event_{name}": [getattr(row, name) for row in rows] for name in ("frame", "frames", "channel")}
    return {
        "event": np.arange(len(rows)),
        "event_kind": np.array([KINDS.index(row.kind) for row in rows], np.int8),
        **{name: np.array(values, np.int64) for name, values in whole.items()},
        "event_ppm": np.array([row.ppm for row in rows], np.float64),
    }


def events_from(values: Mapping[str, Any]) -> tuple[Event, ...]:
    """Events from their stored values, () for a file without a journal; raises BrokenFileError for invalid numbers."""
    if any(f"event_{name}" not in values for name in ("kind", "frame", "frames", "channel", "ppm")):
        return ()
    kind, first, frames = values["event_kind"], values["event_frame"], values["event_frames"]
    if len(kind) and not (0 <= kind.min() <= kind.max() < len(KINDS) and first.min() >= 0 and frames.min() >= 0):
        raise BrokenFileError(f"events: expected kinds 0 to {len(KINDS) - 1} at frames from 0 on, got others")
    columns = zip(kind, first, frames, values["event_channel"], values["event_ppm"], strict=True)
    return tuple(
        Event(kind=KINDS[int(k)], frame=int(f), frames=int(n), channel=int(c), ppm=float(p))
        for k, f, n, c, p in columns
    )


def with_events(provenance: Provenance, events: Iterable[Event], frames: int) -> Provenance:
    """Add the events within `frames` frames to the provenance as step "events", if there are any."""
    # The journal is flushed before the samples, so that events of an interrupted recording may lie beyond its end.
    inside = tuple(event for event in events if event.frame < frames)
    return provenance.then("events", _settings(inside, frames)) if inside else provenance


def _settings(events: tuple[Event, ...], frames: int) -> dict[str, Setting]:
    of = {kind: [event for event in events if event.kind == kind] for kind in KINDS}
    settings: dict[str, Setting] = {}
    for kind in ("lost", "late"):
        if of[kind]:
            runs = [(event.frame, min(event.frames, frames - event.frame)) for event in of[kind]]
            settings |= {f"{kind}_frames": sum(count for _, count in runs), kind: tuple(runs[:LISTED])}
    for kind in ("clipped", "mended"):
        if of[kind]:
            settings[f"{kind}_frames"] = sum(event.frames for event in of[kind])
            settings[kind] = tuple((event.channel, event.frame, event.frames) for event in of[kind][:LISTED])
    for kind in ("dead", "stuck"):
        if of[kind]:
            settings[kind] = tuple((event.channel, event.frame) for event in of[kind][:LISTED])
    for kind in ("rate", "clock"):
        if of[kind]:
            settings[f"{kind}_ppm"] = of[kind][-1].ppm
    if of["trigger"]:
        settings["trigger"] = of["trigger"][0].frame
    if of["stroke"]:
        settings["strokes"] = tuple((row.frame, min(row.frames, frames - row.frame)) for row in of["stroke"][:LISTED])
    return settings


LISTED_STAMPS = 2000
"""Maximum number of positions in the provenance: 200 s of strokes at ten per second."""

COLUMNS = ("stage_time", "stage_x", "stage_y", "stage_z", "stage_feed")


def stage_values(stamps: Iterable[StageStamp]) -> dict[str, Any]:
    """Stored values of stage positions."""
    table = np.array([(stamp.time, *stamp.position, stamp.feed) for stamp in stamps], np.float64).reshape(-1, 5)
    return {"stage": np.arange(len(table)), **dict(zip(COLUMNS, table.T, strict=True))}


def stamps_from(values: Mapping[str, Any]) -> tuple[StageStamp, ...]:
    """Stage positions from their stored values, () for a file without a stage; raises BrokenFileError if not finite."""
    if any(name not in values for name in COLUMNS):
        return ()
    table = np.column_stack([values[name] for name in COLUMNS])
    if not np.isfinite(table).all():
        raise BrokenFileError("stage: expected finite times, places and speeds, got others")
    return tuple(StageStamp(time=t, position=(x, y, z), feed=feed) for t, x, y, z, feed in table.tolist())


def with_stage(
    provenance: Provenance, stamps: Sequence[StageStamp], events: Iterable[Event], rate: float
) -> Provenance:
    """Add the stage positions of a recording at `rate` (Hz) to the provenance as step "stage", if there are any."""
    if not stamps:
        return provenance
    strokes = [event for event in events if event.kind == "stroke"]
    speeds = [
        speed_of([one for one in stamps if event.frame <= one.time * rate <= event.frame + event.frames])
        for event in strokes
    ]
    settings: dict[str, Setting] = {
        "strokes": len(strokes),
        "speed_m_s": tuple(speeds),
        "columns": ("time_s", "x_m", "y_m", "z_m", "feed_m_s"),
        "stamps": tuple((one.time, *one.position, one.feed) for one in stamps[:LISTED_STAMPS]),
    }
    return provenance.then("stage", settings)


PLAYED = ("time", "phase_steps", "intensity", "instant", "state")
"""Datasets that grow with the frames."""


def played_values(array: TransducerArray, rate: float, provenance: Provenance) -> dict[str, Any]:
    """Stored values before the first frame."""
    return {
        **signature("played", provenance),
        "rate_hz": rate,
        "time": np.zeros(0),
        **array_values(array),
        "phase_steps": np.zeros((0, array.count), np.uint8),
        "intensity": np.zeros(0, np.uint8),
        "instant": np.zeros(0, np.int64),
        "state": np.zeros(0, np.int8),
    }


def load_played(path: str | os.PathLike[str]) -> PlayedTouch | None:
    """Read the live touch that was played during a recording; None if there was none.

    The file may still be open for writing, or its writer may have been killed. Errors are those of `load_solution`.
    """
    with open_file(path) as file:
        check_kind(file, "recording", Path(path))
        if "played" not in file:
            return None
        live = not stored_dataset(file, "finished")[()]
        values = read_group(stored_group(file, "played"), "played", Path(path), live=live)
        if live:
            # After a writer was killed, frames without a time were not written.
            frames = int(np.isfinite(values["time"]).sum())
            values |= {name: values[name][:frames] for name in PLAYED}
        check_time(values, Path(path))
        return PlayedTouch(
            **{name: values[name] for name in PLAYED[1:]},
            rate=values["rate_hz"],
            array=array_from(values),
            provenance=from_json(values["provenance"]),
        )


def write_recording(
    recording: Recording,
    path: Path,
    calibration: Calibration | None,
    pressure: PressureFrames | None = None,
    *,
    journal: Sequence[Event] = (),
    played: PlayedTouch | None = None,
) -> tuple[FormatLoss, ...]:
    """Write a recording with its calibration, pressure and live touch, atomically and without loss.

    Samples are stored as float32 if that holds all of them.
    """
    if pressure is not None and pressure.sensor.shape != recording.sensor.shape:
        raise MismatchError(
            f"{path}: expected pressure of {recording.sensor.shape} cells, got {pressure.sensor.shape}; "
            "save the pressure of this recording"
        )
    values = recording_values(recording)
    if journal:
        values |= event_values(journal)
    samples = values["samples"]
    size = samples.size * np.dtype(samples.stored if isinstance(samples, LazyFrames) else samples.dtype).itemsize
    room = 8 * recording.frames + size + (0 if pressure is None else pressure.pressure.nbytes)
    with new_file(path, room=room) as file:
        write_group(file, "recording", values)
        if calibration is not None:
            write_calibration(file.create_group("calibration"), calibration)
        if pressure is not None:
            band = {} if pressure.band is None else {"band_low_hz": pressure.band[0], "band_high_hz": pressure.band[1]}
            stored = {
                **signature("pressure", pressure.provenance),
                **time_values(pressure.frames, pressure.rate),
                **sensor_values(pressure.sensor),
                **band,
                "pressure": pressure.pressure,
            }
            write_group(file.create_group("pressure"), "pressure", stored)
        if played is not None:
            stored = played_values(played.array, played.rate, played.provenance)
            stored |= {"time": np.arange(played.frames) / played.rate}
            stored |= {name: getattr(played, name) for name in PLAYED[1:]}
            write_group(file.create_group("played"), "played", stored)
    return ()


def read_recording(path: Path, given: ImportOptions) -> OpenedTake:
    """Read a recording, up to three times while it is being written, because a read can fall between two commits."""
    for _ in range(2):
        try:
            return _read_once(path, given)
        except BrokenFileError:
            if not is_unclosed(path):
                raise
    return _read_once(path, given)


def _read_once(path: Path, given: ImportOptions) -> OpenedTake:
    with open_file(path) as file:
        values, report = read_values(file, path, streamed=given.streamed)
        take = take_from(values, path)
        given.check(take.recording, path)
        calibration = read_calibration(stored_group(file, "calibration"), path) if "calibration" in file else None
        return replace(take, calibration=calibration, report=report)


def read_values(
    file: "h5py.File", path: Path, *, streamed: bool, damage: dict[str, Ranges] | None = None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Stored values of a recording, cut to complete frames, and a report of that; `damage` as in `read_group`."""
    check_kind(file, "recording", path)
    live = not stored_dataset(file, "finished")[()]
    values = read_group(file, "recording", path, live=live, streamed=streamed, damage=damage)
    return _whole_frames(values, path) if live else (values, ())


def take_from(values: Mapping[str, Any], path: Path, gaps: Sequence[Event] = ()) -> OpenedTake:
    """A recording from its stored values, with further events."""
    check_time(values, path)
    journal, stamps = (*events_from(values), *gaps), stamps_from(values)
    life = with_events(from_json(values["provenance"]), journal, len(values["time"]))
    recording = Recording(
        samples=finite(values["samples"], "samples"),
        rate=values["rate_hz"],
        sensor=sensor_from(values),
        unit=values["unit"],
        provenance=with_stage(life, stamps, journal, values["rate_hz"]),
    )
    return OpenedTake(recording=recording, journal=journal, stored=True)


class RecordingBuffer:
    """Keeps a growing recording in memory, with the parameters and methods of `RecordingWriter`."""

    def __init__(
        self,
        *,
        rate: float,
        sensor: SensorGrid,
        unit: Unit,
        provenance: Provenance,
        calibration: Calibration | None = None,
    ) -> None:
        self.rate, self.sensor, self.provenance, self.calibration = rate, sensor, provenance, calibration
        self.unit: Unit = unit
        self.frames = 0
        self._blocks: list[np.ndarray] = []
        self._events: list[Event] = []
        self._stamps: list[StageStamp] = []

    def append(self, block: ArrayLike) -> None:
        """Append frames, shape (frame, row, column)."""
        self._blocks.append(np.array(block, np.float64))
        self.frames += len(self._blocks[-1])

    def note(self, events: Iterable[Event]) -> None:
        """Store events."""
        self._events.extend(events)

    def stamp(self, stamps: Iterable[StageStamp]) -> None:
        """Store stage positions with times from frame 0 on."""
        self._stamps.extend(stamps)

    def take(self) -> OpenedTake:
        """The recording so far, as it would be read from a file."""
        journal = tuple(self._events)
        life = with_events(self.provenance, journal, self.frames)
        recording = Recording(
            samples=np.concatenate(self._blocks),
            rate=self.rate,
            sensor=self.sensor,
            unit=self.unit,
            provenance=with_stage(life, self._stamps, journal, self.rate),
        )
        return OpenedTake(recording=recording, calibration=self.calibration, journal=journal)


def save_pressure(pressure: PressureFrames, path: str | os.PathLike[str]) -> None:
    """Store calibrated pressure in the file of its recording, in place of an earlier one; the file is replaced.

    Raises MismatchError if the pressure has another sensor shape and FileError if the file cannot be read or written.
    """
    take = read_recording(Path(path), ImportOptions(streamed=True))
    write_recording(take.recording, Path(path), take.calibration, pressure, played=load_played(path))


def load_pressure(path: str | os.PathLike[str], *, streamed: bool = False) -> PressureFrames | None:
    """Read the calibrated pressure in a recording's file, lazily if `streamed`; None if it has none.

    Errors are those of `load_solution`.
    """
    with open_file(path) as file:
        check_kind(file, "recording", Path(path))
        if "pressure" not in file:
            return None
        values = read_group(stored_group(file, "pressure"), "pressure", Path(path), streamed=streamed)
        check_time(values, Path(path))
        low, high = values.get("band_low_hz"), values.get("band_high_hz")
        return PressureFrames(
            pressure=finite(values["pressure"], "pressure"),
            rate=values["rate_hz"],
            sensor=sensor_from(values),
            band=None if low is None or high is None else (low, high),
            provenance=from_json(values["provenance"]),
        )


def recording_values(recording: Recording) -> dict[str, Any]:
    """Stored values of a recording."""
    return {
        **signature("recording", recording.provenance),
        **time_values(recording.frames, recording.rate),
        **sensor_values(recording.sensor),
        "unit": recording.unit,
        "samples": single(recording.samples),
        "finished": 1,
    }


def _whole_frames(values: dict[str, Any], path: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Complete frames of an unfinished recording, and a report of their number."""
    samples = values["samples"]
    frames = _written(samples)
    if frames == 0:
        raise BrokenFileError(f"{path}: the recording stopped before its first frame was written; record it again")
    seconds = frames / values["rate_hz"]
    text = f"The recording was not closed: it still runs or was killed. {frames} frames, {seconds:g} s, could be read."
    return {**values, "samples": samples[:frames], "time": values["time"][:frames]}, (text,)


def _written(samples: "np.ndarray | LazyFrames") -> int:
    """Number of frames up to the last that is not NaN; unwritten frames are NaN."""
    for first, last in reversed(list(block_ranges(samples.shape))):
        block = samples.read(first, last) if isinstance(samples, LazyFrames) else samples[first:last]
        there = np.asarray(~np.isnan(block).all(axis=(1, 2)))
        if there.any():
            return last - int(np.argmax(there[::-1]))
    return 0


HDF5 = Format(name="HDF5 of midair", read=read_recording, write=write_recording)
