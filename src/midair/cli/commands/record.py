"""The command `record`: record takes of a sensor with meters, keys, a trigger and repeats."""

import sys
import time
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from midair.cli.console import banner, err, print_json, print_rows, verbosity
from midair.cli.keys import Keys, Signals, signals_noted
from midair.cli.meter_screen import MeterScreen
from midair.cli.options import Json, Quiet, options_from, settings_from
from midair.cli.output import sensor_text
from midair.cli.quantities import parse_quantity
from midair.cli.stage_options import Drawing, StageOptions, recorded_strokes, stroke_rows
from midair.devices import PacedSensor, SensorDevice
from midair.errors import DeviceError, InputError
from midair.files import open_take
from midair.model import Provenance
from midair.rig import (
    RecordSettings,
    Subject,
    Take,
    VirtualRig,
    last_subject,
    record_take,
    sensor_named,
    store_subject,
    take_path,
    take_problems,
)


@options_from(Subject)
class SubjectOptions:
    """Object and stroke, stored with the recording."""


@options_from(RecordSettings)
class RecordOptions:
    """Begin, end and number of takes, and the sensor."""


def record_command(
    sensor: str,
    output: Path | None = None,
    /,
    *,
    subject: SubjectOptions | None = None,
    options: RecordOptions | None = None,
    staging: StageOptions | None = None,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Record a sensor to a file.

    Frames are written to the file as they arrive.
    On a terminal, space or Enter starts and stops a take (without --duration and --trigger), and q ends.
    Lost frames repeat the last value; they are reported and logged in the file.
    The exit status is 1 if nothing was recorded or a take ended early.

    Parameters
    ----------
    sensor
        Sensor to record, one of these or a real one (midair doctor lists them).
        virtual:towel, virtual:brush, virtual:sponge: simulated strokes; add +groove for the grooved surface.
        virtual:am-i, virtual:am-ii, virtual:am-iii: modulated foci (paper, section 5.2).
        replay:FILE: a recording.
    output
        File NAME.h5 or folder; existing files are not overwritten. [default: OBJECT-SURFACE-01.h5 and so on]

    Examples
    --------
    $ midair record virtual:towel towel.h5 --duration 1s
    $ midair record "lsl:Skin?unit=V" --object towel --repeats 5
    """
    options, quiet = options or RecordOptions(), quiet or verbosity().quiet
    trigger: str | None = getattr(options, "level", None)
    settings = settings_from(RecordSettings, options, sensor=sensor, level=None)
    stated: dict[str, Any] = {one.name: getattr(subject or SubjectOptions(), one.name) or "" for one in fields(Subject)}
    speed: float | None = stated["speed"] or None
    drawing = (staging or StageOptions()).drawing(speed)
    stated["speed"] = "" if speed is None else f"{speed * 1e3:.6g}mm/s"
    if drawing is not None and (settings.duration is not None or trigger is not None):
        raise InputError("--stage: expected neither --duration nor --trigger; a take begins and ends with the stroke")
    touches = settings.duration if drawing is None else drawing.seconds
    device = sensor_named(sensor, VirtualRig(seed=settings.seed), duration=touches, wiring=settings.wiring)
    real_time = settings.real_time or drawing is not None
    ask = not (quiet or json) and (real_time or not device.on_demand)
    about = _subject(sensor, Subject(**stated), ask=ask)
    take_path(output, about, repeats=settings.repeats)
    if drawing is None and sensor.startswith("virtual:") and settings.duration is None:
        settings = settings.but(duration=0.5 if "am-" in sensor else 1.28)
    ends = settings.duration is not None or device.on_demand
    device = PacedSensor(device) if real_time and device.on_demand else device
    banner(device.simulated)
    with ExitStack() as held, signals_noted() as signals, Keys() as keys:
        takes: list[Take] = []
        screen = MeterScreen(held.enter_context(device), err(), keys, signals, quiet=quiet)
        if trigger is not None:
            settings = settings.but(level=_level(trigger, device))
        if drawing is not None:
            held.enter_context(drawing)
        by_itself = drawing is not None or (ends and (settings.repeats == 1 or settings.pause is not None))
        key = keys.active and not by_itself and trigger is None
        try:
            for take in _takes(device, screen, signals, settings, output, about, drawing, key=key):
                takes.append(take)
                if take.frames and not json:
                    print_rows(take_rows(take, device, staged=drawing is not None))
        finally:
            if json:
                print_json([take_values(take, device, staged=drawing is not None) for take in takes if take.frames])
        # A signal in a pause between takes: the last take is complete, the remaining ones are missing.
        if signals.came and takes[-1].end != "kill" and len(takes) < settings.repeats:
            err().print(f"midair: stopped; kept {len(takes)} of {settings.repeats} takes")
            return 130
        return _status(takes, device)


def _takes(
    device: SensorDevice,
    screen: MeterScreen,
    signals: Signals,
    settings: RecordSettings,
    output: Path | None,
    about: Subject,
    drawing: Drawing | None,
    *,
    key: bool,
) -> Generator[Take]:
    """Record the takes and yield each when it ends; a motion stage returns to the start after each."""
    many, kind = settings.repeats, "take" if drawing is None else "stroke"
    waits = key or settings.level is not None
    if drawing is not None:
        drawing.prepare(many, lambda: bool(signals.came))
        if not screen.asks("space or Enter: go"):
            raise DeviceError("ended before the first stroke: nothing moved and nothing was recorded")
        drawing.to_start(screen.ends)
    for number in range(1, many + 1):
        path = take_path(output, about, repeats=many)
        noted = ({} if drawing is None else drawing.settings) | (
            {"take": number, "takes": many} if many > 1 or drawing is not None else {}
        )
        # The recorder reads keys between frames; signals act at once.
        companion = None if drawing is None else drawing.companion(lambda: bool(signals.came))
        with screen.take(f"{path.name}, {kind} {number} of {many}" if many > 1 or drawing else path.name):
            take = record_take(device, settings, screen, companion, path=path, notes=about.notes, about=noted, key=key)
        yield take
        if take.end in ("quit", "kill", "failure") if drawing is None else take.end != "companion":
            if drawing is not None and take.end != "failure":
                err().print(drawing.stands)
            return
        if drawing is not None:
            drawing.to_start(screen.ends)
        if number < many and not waits and not _wait_pause(settings, device, screen, staged=drawing is not None):
            return


def _wait_pause(settings: RecordSettings, device: SensorDevice, screen: MeterScreen, *, staged: bool) -> bool:
    """Wait for the pause; False if a key or a signal ends the session."""
    pause = settings.pause if settings.pause is not None else 0.0 if device.on_demand or staged else 2.0
    end = time.monotonic() + pause
    while (left := end - time.monotonic()) > 0:
        if screen.order() in ("quit", "kill"):
            return False
        time.sleep(min(0.05, left))
    return True


def _level(text: str, device: SensorDevice) -> float:
    """Trigger level in the sensor's unit."""
    try:
        return parse_quantity(text, device.unit)
    except ValueError as wrong:
        raise InputError(f"--trigger: {wrong}; {device.name} gives {device.unit}") from None


def _subject(sensor: str, stated: Subject, *, ask: bool) -> Subject:
    """Notes on the object: as given, from the name of a virtual sensor, or from questions on the terminal."""
    kind, _, rest = sensor.partition(":")
    if kind == "virtual" and not stated.object:
        name, _, surface = rest.partition("+")
        return replace(stated, object=name, surface=stated.surface or surface)
    console = err()
    if not (ask and console.is_terminal and sys.stdin.isatty()):
        return stated
    before = last_subject().notes
    said = asdict(stated)
    for name in [name for name, value in said.items() if not value]:
        # Enter keeps the last answer.
        default = before.get(name, "")
        said[name] = console.input(f"{name} [{default}]: " if default else f"{name}: ").strip() or default
    about = Subject(**said)
    store_subject(about)
    return about


def _status(takes: list[Take], device: SensorDevice) -> int:
    """Exit status 0 if everything was recorded; otherwise report the reason."""
    last = takes[-1]
    if last.end == "kill":
        kept = f"{last.frames} frames are in {last.path}" if last.frames else "this take has no frames"
        err().print(f"midair: stopped; {kept}{last.problem and f'; {last.problem}'}")
        return 130
    if last.end == "failure":
        kept = f"the {last.frames} frames so far are safe"
        raise DeviceError(last.problem if kept in last.problem else f"{last.problem}; {kept}, in {last.path}")
    if not any(take.frames for take in takes):
        raise DeviceError(f"{device.name}: nothing was recorded; the session ended before a take began")
    return 0


def take_rows(take: Take, device: SensorDevice, *, staged: bool = False) -> list[tuple[str, str]]:
    """A take as rows, with its problems; with its strokes if a motion stage moved the object."""
    return [
        ("recording", str(take.path)),
        ("frames", f"{take.frames} at {device.rate:.6g} Hz, {take.frames / device.rate:.3f} s"),
        ("sensor", sensor_text(device.grid)),
        ("range", f"{take.lowest:.4g} to {take.highest:.4g} {device.unit}"),
        *(stroke_rows(_provenance(take), device.rate) if staged else []),
        *take_problems(take, device.rate),
    ]


def take_values(take: Take, device: SensorDevice, *, staged: bool = False) -> dict[str, object]:
    """A take as JSON values."""
    levels, strokes = take.levels, recorded_strokes(_provenance(take), device.rate) if staged else []
    return {
        "recording": str(take.path),
        "frames": take.frames,
        "rate_hz": device.rate,
        "lost_frames": take.lost,
        "end": take.end,
        "range": [take.lowest, take.highest],
        "clipped_channels": levels.clipped.nonzero()[0].tolist(),
        "dead_channels": levels.dead.nonzero()[0].tolist(),
        "stuck_channels": levels.stuck.nonzero()[0].tolist(),
        "rate_ppm": None if take.rate is None else take.rate.ppm,
        "clock_ppm": None if take.clock is None else take.clock.ppm,
        **({"strokes": strokes} if strokes else {}),
    }


def _provenance(take: Take) -> Provenance:
    """Provenance with the events of the recording, from the file."""
    return Provenance() if take.path is None else open_take(take.path, streamed=True).recording.provenance
