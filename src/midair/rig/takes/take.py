"""Record one take: wait for a key or a touch, keep the frames as they arrive, report problems, and continue.

A lost frame is replaced by the last good one, so that frame i stays at i / rate; the event is reported and stored. A
take fails only without any frame. If the sensor is lost or the disk is full, the frames so far are kept.
Takes that belong together share a subject and the start of their file names.
"""

import json
import re
import time
import unicodedata
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices import FrameBlock, GapFiller, SensorDevice, make_state_folder, state_folder
from midair.errors import DeviceError, FileError, InputError, MidairError, MissingFileError
from midair.files import RecordingBuffer, RecordingWriter, writable_path, write_file
from midair.model import Event, EventKind, Provenance, Setting
from midair.rig.takes.meters import Meters, PreRoll, Trigger
from midair.rig.takes.stage_strokes import StageStrokes
from midair.rig.takes.take_state import (
    ClockWatch,
    Drift,
    EndReason,
    RecordSettings,
    Take,
    TakeObserver,
    TakeOrder,
    View,
)
from midair.validation import Declared, documented, setting

DRIFT_TOLD = 200.0
"""Drift in ppm above which an event is reported; quartz clocks differ by about 100 ppm at most."""


def record_take(
    sensor: SensorDevice,
    settings: RecordSettings,
    observer: TakeObserver,
    stroke: StageStrokes | None = None,
    *,
    path: Path | None = None,
    notes: Mapping[str, str] | None = None,
    about: Mapping[str, Setting] | None = None,
    key: bool = False,
    block: float = 0.05,
) -> Take:
    """Record one take with an open sensor, which is started and stopped here.

    It begins with a touch if the settings have a level, at the command "toggle" of the observer if `key`, and else at
    once; settings of the sensor or of several takes are ignored. A stroke begins with the first frame and ends the
    take; if the take ends earlier, it is stopped. A file is written during the recording, so that the frames survive a
    crash; without `path` they are kept in memory. `about` are further settings of the step "record" in the provenance,
    such as the number of the take; `block` is the duration of one read in s.

    InputError if the duration is shorter than one frame, FileError if the file cannot be created, DeviceError if the
    sensor gives no frames, or is lost before the first frame.
    """
    if settings.duration is not None and round(settings.duration * sensor.rate) < 1:
        shortest = 1e3 / sensor.rate
        raise InputError(f"duration: expected at least one frame of {shortest:g} ms, got {settings.duration:g} s")
    if path is not None:
        # Before the sensor starts, since frames would queue up while the library is loaded.
        RecordingWriter.warm_up()
    sensor.start()
    try:
        with ExitStack() as stack:
            run = _TakeRun(sensor, settings, observer, stroke, path, stack, notes or {}, about or {}, key=key)
            return run.run(max(1, round(block * sensor.rate)))
    finally:
        if stroke is not None:
            stroke.end()
        sensor.stop()


class _TakeRun:
    """State of a running take."""

    def __init__(
        self,
        sensor: SensorDevice,
        settings: RecordSettings,
        observer: TakeObserver,
        stroke: StageStrokes | None,
        path: Path | None,
        stack: ExitStack,
        notes: Mapping[str, str],
        about: Mapping[str, Setting],
        *,
        key: bool,
    ) -> None:
        self._sensor, self._settings, self._observer = sensor, settings, observer
        self._stroke, self._path, self._stack, self._about = stroke, path, stack, about
        self._provenance = Provenance(source=sensor.name, simulated=sensor.simulated, notes=notes)
        self._start = "touch" if settings.level is not None else "key" if key else "at once"
        self._gap_filler = GapFiller(sensor.name, sensor.rate)
        self._meters = Meters(sensor.grid.count, sensor.rate, full_scale=sensor.full_scale)
        self._rate, self._clock = ClockWatch(), ClockWatch()
        self._watches: tuple[tuple[EventKind, ClockWatch], ...] = (("rate", self._rate), ("clock", self._clock))
        self._trigger = None if settings.level is None else Trigger(settings.level, sensor.rate)
        self._before = PreRoll(round(settings.pre_roll * sensor.rate))
        self._writer: RecordingWriter | RecordingBuffer | None = None
        # Bounded, since a take may wait for a touch for hours.
        self._early: deque[Event] = deque(maxlen=1000)
        self._reported: set[EventKind] = set()
        self._origin = self._lost = self._held = 0
        # Time of the sensor's frame 0 by this computer's clock: blocks arrive late, never early.
        self._zero = np.inf
        self._latest = -np.inf
        self._wanted: int | None = None
        self._quiet = 0
        self._range = np.inf, -np.inf

    def run(self, frames: int) -> Take:
        """Read blocks of `frames` frames until the take ends."""
        end: EndReason | None = None
        error: MidairError | None = None
        while end is None:
            try:
                end = self._step(frames)
            except (DeviceError, FileError) as wrong:
                if self._frames == 0:
                    raise
                end, error = "failure", wrong
        if end == "source" and self._frames == 0 and self._gap_filler.frames == 0:
            raise DeviceError(f"{self._sensor.name}: expected frames, got none; is it connected and switched on?")
        if self._stroke is not None and error is None:
            # Its positions until now belong to the take.
            self._stroke.end()
            try:
                self._follow_stroke()
            except (DeviceError, FileError) as wrong:
                error = wrong
        for kind, watch in self._watches:
            if (drift := watch.drift()) is not None and self._frames and end != "failure":
                self._store([Event(kind=kind, frame=self._origin + self._frames - 1, ppm=drift.ppm)])
        return Take(
            path=None if self._writer is None else self._path,
            memory=self._writer.take() if isinstance(self._writer, RecordingBuffer) else None,
            frames=self._frames,
            lost=self._held,
            end=end,
            error=error,
            levels=self._meters.levels,
            lowest=self._range[0],
            highest=self._range[1],
            rate=self._rate.drift(),
            clock=self._clock.drift(),
        )

    @property
    def _frames(self) -> int:
        return 0 if self._writer is None else self._writer.frames

    def _step(self, frames: int) -> EndReason | None:
        """Read and process a block; return the reason if the take has ended."""
        if (order := self._observer.order()) in ("quit", "kill"):
            return order
        if self._writer is None and self._start == "key" and self._sensor.on_demand and order is None:
            # Reading would consume an on-demand source before a key is pressed.
            time.sleep(frames / self._sensor.rate)
            self._show()
            return None
        block = self._sensor.read(frames)
        if not len(block.samples):
            if self._stroke is not None:
                raise DeviceError(
                    f"{self._sensor.name}: expected frames to the end of the stroke, the sensor ended early"
                )
            return "source"
        samples = self._receive(block)
        self._zero = min(self._zero, block.host_time - block.first / self._sensor.rate)
        end = self._keep(samples, order) if self._writer is not None else self._wait(samples, order)
        self._show()
        return end or self._follow_stroke()

    def _follow_stroke(self) -> EndReason | None:
        """Store what the stage reports; return the reason if it ended the take."""
        stroke = self._stroke
        if stroke is None or self._writer is None:
            return None
        # Before its reports are taken, so that none comes later.
        over, begin = stroke.over, self._zero + self._origin / self._sensor.rate
        taken = [stroke.stamps.popleft() for _ in range(len(stroke.stamps))]
        stamps = [replace(stamp, time=stamp.time - begin) for stamp in taken]
        self._writer.stamp(stamps)
        for first, last in [stroke.strokes.popleft() for _ in range(len(stroke.strokes))]:
            frames = round((last - first) * self._sensor.rate)
            frame = max(0, round((first - self._zero) * self._sensor.rate))
            self._report([Event(kind="stroke", frame=frame, frames=frames)])
        if stroke.problem:
            raise DeviceError(stroke.problem)
        self._latest = max([self._latest, *(stamp.time for stamp in stamps)])
        # Frames arrive with a delay: those of its last moment still belong to the take.
        return "stroke" if over and self._frames >= self._latest * self._sensor.rate else None

    def _receive(self, block: FrameBlock) -> Array:
        """Fill the gaps of a block, and report its events."""
        seamless = self._gap_filler.add(block)
        if seamless.lost or block.overflow:
            self._lost += seamless.lost
            self._report([Event(kind="lost", frame=seamless.first, frames=seamless.lost)])
        self._report(self._meters.add(seamless.samples))
        if not self._sensor.on_demand:
            # An on-demand source has no clock.
            self._rate.add(block.first / self._sensor.rate, block.host_time)
            self._clock.add(block.device_time, block.host_time)
            for kind, watch in self._watches:
                drift = None if kind in self._reported else watch.drift()
                if drift is not None and drift.certain and abs(drift.ppm) > DRIFT_TOLD:
                    self._reported.add(kind)
                    self._report([Event(kind=kind, frame=self._gap_filler.frames - 1, ppm=drift.ppm)], drift)
        return seamless.samples

    def _wait(self, samples: Array, order: TakeOrder | None) -> EndReason | None:
        """Begin if the start condition is met, else buffer the frames for the pre-roll."""
        past = np.zeros(len(samples), bool) if self._trigger is None else self._trigger.exceeded(samples)
        if self._start == "touch" and order is None:
            begin = int(past.argmax()) if past.any() else None
        else:
            begin = 0 if self._start == "at once" or order == "toggle" else None
        if begin is None:
            self._before.add(samples)
            return None
        self._before.add(samples[:begin])
        early = self._before.take()
        now = self._gap_filler.frames - len(samples) + begin
        kept = 0 if early is None else len(early)
        self._open(now - kept, kept)
        if early is not None:
            self._write(early)
        return self._keep(samples[begin:], None, past[begin:])

    def _open(self, origin: int, kept: int) -> None:
        """Begin the recording, whose frame 0 is frame `origin` of the sensor."""
        sensor, chosen = self._sensor, self._settings
        settings: dict[str, Setting] = dict(self._about)
        if self._start != "at once":
            settings |= {"start": self._start, "pre_roll_s": kept / sensor.rate}
        if chosen.level is not None:
            settings |= {"level": chosen.level}
        if chosen.duration is not None:
            self._wanted = kept + round(chosen.duration * sensor.rate)
        made: dict[str, Any] = {
            "rate": sensor.rate,
            "sensor": sensor.grid,
            "unit": sensor.unit,
            "provenance": self._provenance.then("record", settings) if settings else self._provenance,
            "calibration": sensor.calibration,
        }
        if self._path is None:
            self._writer = RecordingBuffer(**made)
        else:
            writer = RecordingWriter(self._path, expected=self._wanted or 0, stored=sensor.stored, **made)
            self._writer = self._stack.enter_context(writer)
        self._origin = origin
        if self._stroke is not None:
            self._stroke.begin()
        # Earlier events that concern the recorded frames.
        still = self._meters.levels.dead | self._meters.levels.stuck
        for event in self._early:
            if event.kind in ("dead", "stuck"):
                self._store([replace(event, frame=max(event.frame, origin))] if still[event.channel] else [])
            elif (after := event.frame + event.frames - origin) > 0:
                self._store([replace(event, frame=max(event.frame, origin), frames=min(event.frames, after))])
        self._early.clear()
        if self._start == "touch":
            self._report([Event(kind="trigger", frame=origin + kept)])

    def _keep(self, samples: Array, order: TakeOrder | None, past: NDArray[np.bool_] | None = None) -> EndReason | None:
        """Write frames; return the reason if the take has ended."""
        if self._wanted is not None:
            samples = samples[: self._wanted - self._frames]
        self._write(samples)
        if self._wanted is not None and self._frames >= self._wanted:
            return "duration"
        if order == "toggle":
            return "toggle"
        post_roll = self._settings.post_roll if self._wanted is None else None
        if self._trigger is None or post_roll is None:
            return None
        past = self._trigger.exceeded(samples) if past is None else past
        self._quiet = int(past[::-1].argmax()) if past.any() else self._quiet + len(past)
        return "quiet" if self._quiet >= post_roll * self._sensor.rate else None

    def _write(self, samples: Array) -> None:
        if self._writer is not None and len(samples):
            self._writer.append(samples)
            self._range = min(self._range[0], float(samples.min())), max(self._range[1], float(samples.max()))

    def _report(self, events: Sequence[Event], drift: Drift | None = None) -> None:
        for event in events:
            self._observer.tell(event, drift)
        if self._writer is None:
            self._early.extend(events)
        else:
            self._store(events)

    def _store(self, events: Sequence[Event]) -> None:
        """Store events with frames counted from the start of the file and cut to its planned length."""
        rows = [replace(event, frame=max(0, event.frame - self._origin)) for event in events]
        if self._wanted is not None:
            rows = [replace(row, frames=min(row.frames, max(0, self._wanted - row.frame))) for row in rows]
        self._held += sum(row.frames for row in rows if row.kind == "lost")
        if self._writer is not None:
            self._writer.note(rows)

    def _show(self) -> None:
        self._observer.show(
            View(
                state="waiting" if self._writer is None else "recording",
                frames=self._frames,
                wanted=self._wanted,
                lost=self._lost,
                levels=self._meters.levels,
                rate=self._rate.drift(),
                clock=self._clock.drift(),
            )
        )


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Subject(Declared):
    """Subject of a recording; empty fields are unknown."""

    object: str = setting(
        "", "Name of the object, such as towel; asked for on a terminal if missing.", typed=str | None
    )
    surface: str = setting("", "Sensor surface, such as flat or grooved.", typed=str | None)
    speed: str = setting("", "Speed of the stroke, such as 50mm/s.", unit="m/s", typed=float | None)
    operator: str = setting("", "Name of the person who records.", typed=str | None)

    @property
    def notes(self) -> dict[str, str]:
        """Known fields, for the notes of a recording."""
        return {name: value for name, value in asdict(self).items() if value}

    @property
    def stem(self) -> str:
        """Start of the file names: object-surface."""
        return "-".join(part for part in (slug(self.object), slug(self.surface)) if part) or "recording"


def slug(text: str) -> str:
    """Convert text to a part of a file name: lower-case letters and digits of any script, underscores for the rest."""
    small = unicodedata.normalize("NFKC", text).casefold()
    return re.sub(r"[^\w.]+|_+", "_", small).strip("_.")[:60]


def take_name(folder: Path, stem: str) -> Path:
    """Next name in a folder: ``stem-01.h5``, or one above the highest number; MissingFileError without the folder."""
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: expected a folder for the recordings, found none; make it first")
    numbers = [
        int(found[1])
        for path in folder.iterdir()
        if (found := re.fullmatch(rf"{re.escape(stem)}-(\d+)\.h5", path.name))
    ]
    return folder / f"{stem}-{max(numbers, default=0) + 1:02d}.h5"


def take_path(output: Path | None, subject: Subject, *, repeats: int) -> Path:
    """Path of the next of `repeats` takes.

    `output` is a folder (the current one if None), in which the name is made from the subject; or the name of a single
    take, or the start of the names of several. InputError if the name does not end in .h5 or the file exists,
    MissingFileError if the folder does not.
    """
    if output is None or output.is_dir():
        return take_name(output or Path(), subject.stem)
    if output.suffix != ".h5":
        raise InputError(f"{output}: expected NAME.h5, or an existing folder")
    if repeats > 1:
        return take_name(output.parent, output.stem)
    if output.exists():
        raise InputError(f"{output}: already exists; give another name, or a folder for a new name")
    writable_path(output)
    return output


def last_subject() -> Subject:
    """Subject of the last recording, as a default for prompts; an empty one if there is none."""
    try:
        stored = json.loads((state_folder() / "subject.json").read_text(encoding="utf-8"))
        return Subject(**{each.name: str(stored.get(each.name, "")) for each in fields(Subject)})
    # It is only a default for prompts, so read errors are ignored.
    except (OSError, ValueError, AttributeError, RecursionError):
        return Subject()


def store_subject(subject: Subject) -> None:
    """Store the subject as the default of later prompts; FileError if it cannot be stored."""
    path = make_state_folder() / "subject.json"
    write_file(path, json.dumps(asdict(subject)))
