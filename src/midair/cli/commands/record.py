"""The command `record`: record takes of a sensor with meters, keys, a trigger and repeats."""

import sys
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from midair import devices, files, rig
from midair.cli.console import err, print_json, verbosity
from midair.cli.keys import Keys, Signals, signals_noted
from midair.cli.options import Json, options_from, parse_quantity, quantity, settings_from
from midair.cli.output import calibration_row, describe_strokes, duration_text, next_row, print_table, sensor_text
from midair.errors import DeviceError, InputError
from midair.model import Event, Provenance
from midair.table import Details, Line, Row, plain

WIDTH = 8
"""Width of a bar in characters."""
RANGE = 80.0
"""Range of a bar in dB."""


class MeterScreen(rig.TakeObserver):
    """The user interface of a take: draws meters, prints events, and turns keys and signals into orders."""

    def __init__(
        self,
        sensor: devices.SensorDevice,
        console: Console,
        keys: Keys,
        signals: Signals,
        *,
        quiet: bool = False,
        every: float = 10.0,
    ) -> None:
        self._sensor, self._console, self._keys, self._signals = sensor, console, keys, signals
        self._quiet, self._every = quiet, every
        self._title = ""
        self._shown = -np.inf
        self._clipped: set[int] = set()
        self._live: Live | None = None

    @contextmanager
    def take(self, title: str) -> Generator[None]:
        """Watch a take of this name; the meters disappear at the end."""
        self._title, self._shown = title, -np.inf
        self._clipped.clear()
        if not (self._console.is_terminal and not self._quiet):
            yield
            return
        with Live(console=self._console, auto_refresh=False, transient=True) as self._live:
            try:
                yield
            finally:
                self._live = None

    def order(self) -> rig.TakeOrder | None:
        """Order given by a key or a signal."""
        if self._signals.came:
            return "kill"
        keys = self._keys.pressed()
        if "q" in keys or "Q" in keys:
            return "quit"
        return "toggle" if set(keys) & {" ", "\n", "\r"} else None

    def ends(self) -> bool:
        """Whether a key or a signal ends the session."""
        return self.order() in ("quit", "kill")

    def asks(self, question: str) -> bool:
        """Wait for a key to continue, if keys can be read; False if a key or a signal ends the session."""
        if self._keys.active:
            self._say(f"{question}, q: end")
            while (order := self.order()) is None:
                time.sleep(0.05)
            return order == "toggle"
        return not self.ends()

    def show(self, view: rig.View) -> None:
        """Draw the meters at most ten times a second, or print a line every `every` seconds."""
        now = time.monotonic()
        if self._live is not None and now - self._shown >= 0.1:
            self._shown = now
            self._live.update(meters(view, self._sensor, self._title, keys=self._keys.active), refresh=True)
        elif self._live is None and not self._quiet and now - self._shown >= self._every:
            state = f"{state_line(view, self._sensor.rate)}, lost {view.lost} frames"
            self._say(state if self._shown > 0 else self._title)
            self._shown = now

    def tell(self, event: Event, drift: rig.Drift | None = None) -> None:
        """Print an event; clipping of a channel is printed once per take."""
        if event.kind == "clipped":
            if event.channel in self._clipped:
                return
            self._clipped.add(event.channel)
        if not (self._quiet and event.kind == "trigger"):
            self._say(rig.event_message(event, self._sensor.rate, self._sensor.grid, drift))

    def _say(self, line: str) -> None:
        self._console.print(files.printable(line), markup=False, highlight=False)


def meters(view: rig.View, sensor: devices.SensorDevice, title: str, *, keys: bool = False) -> RenderableType:
    """State, a meter for each cell in its position, and the lost frames."""
    head = Text.assemble(
        ("● REC " if view.state == "recording" else "○ waiting ", "bold red" if view.state == "recording" else "bold"),
        (files.printable(title), ""),
        ("  SIMULATED" if sensor.simulated else "", "bold red"),
    )
    foot = Text(", ".join((state_line(view, sensor.rate), f"lost {view.lost} frames", *clock_lines(view))))
    hint = "space or Enter: " + ("stop" if view.state == "recording" else "start") + ", q: end"
    return Group(head, _grid(view.levels, sensor), foot, *((Text(hint, style="dim"),) if keys else ()))


def state_line(view: rig.View, rate: float) -> str:
    """Recorded time, and the total if known."""
    if view.state == "waiting":
        return "not yet recording"
    whole = "" if view.wanted is None else f" of {view.wanted / rate:.1f}"
    return f"{view.frames / rate:.1f}{whole} s"


def clock_lines(view: rig.View) -> list[str]:
    """Measured clock drifts."""
    named = (("frames", view.rate), ("clock", view.clock))
    return [f"{name} {drift.ppm:+.0f} ± {drift.uncertainty:.0f} ppm" for name, drift in named if drift is not None]


def decibels(level: float, reference: float) -> float:
    """A level in dB re `reference`, at least -99."""
    return max(-99.0, 20 * float(np.log10(max(level, 1e-30) / reference)))


def _grid(levels: rig.Levels, sensor: devices.SensorDevice) -> RenderableType:
    """A meter for each cell; wide grids are broken into lines of four."""
    columns = min(sensor.grid.columns, 4)
    reference = sensor.full_scale or max(float(levels.highest.max()), 1e-30)
    table = Table.grid(padding=(0, 1))
    cells = [_cell(i, levels, reference) for i in range(sensor.grid.count)]
    for first in range(0, len(cells), columns):
        table.add_row(*cells[first : first + columns])
    under = "full scale" if sensor.full_scale else "the strongest so far"
    return Group(table, Text(f"rms in dB under {under} ({reference:.3g} {sensor.unit}); | is the peak", style="dim"))


def _cell(channel: int, levels: rig.Levels, reference: float) -> Text:
    number = f"{channel:2d} "
    for name, flags in (("dead", levels.dead), ("still", levels.stuck)):
        if flags[channel]:
            return Text.assemble((number, "dim"), (f"{name:<{WIDTH}}   -- ", "bold red"))
    rms, peak = (decibels(float(of[channel]), reference) for of in (levels.rms, levels.peak))
    filled = round(WIDTH * min(1.0, max(0.0, 1 + rms / RANGE)))
    mark = min(WIDTH - 1, round(WIDTH * min(1.0, max(0.0, 1 + peak / RANGE))))
    bar = "".join("█" if i < filled else "|" if i == mark else "·" for i in range(WIDTH))
    clips = bool(levels.clipping[channel])
    style = "bold red" if clips else "yellow" if peak > -6 else "green"
    figure = "CLIP" if clips else f"{rms:.0f}"
    return Text.assemble((number, "dim"), (bar, style), (f"{figure:>5} ", style if clips else ""))


@options_from(rig.Subject)
class SubjectOptions:
    """Object and stroke, stored with the recording."""


@options_from(rig.RecordSettings)
class RecordOptions:
    """Begin, end and number of takes, and the sensor."""


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class StageOptions:
    """Motion stage that moves the object over the sensor."""

    stage: str | None = None
    """Move the object with a Grbl 1.1 machine at grbl:PORT, one stroke per take at --speed. Prints its plan first."""
    stroke: Annotated[float | None, quantity("m")] = None
    """Length of a stroke."""
    stage_file: Path = Path("stage.toml")
    """TOML file of the stage: start of the strokes, contact height, approach, return, travel."""
    home: bool = False
    """Home the stage with its limit switches first. The stage moves."""

    def strokes(self, speed: float | None) -> rig.StageStrokes | None:
        """The requested strokes, checked before a device opens; None without --stage."""
        if self.stage is None:
            if self.stroke is not None or self.home:
                raise InputError("--stroke and --home: expected --stage with them, such as --stage grbl:PORT")
            return None
        if self.stroke is None or speed is None or speed <= 0:
            raise InputError("--stage: expected --stroke and --speed, such as --stroke 120mm --speed 50mm/s")
        setup = files.load_stage(self.stage_file)
        setup.check(self.stroke)
        return rig.StageStrokes(rig.stage_named(self.stage), setup, length=self.stroke, speed=speed)


def record_command(
    sensor: str,
    output: Path | None = None,
    /,
    *,
    subject: SubjectOptions | None = None,
    options: RecordOptions | None = None,
    staging: StageOptions | None = None,
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
    options, quiet = options or RecordOptions(), verbosity().quiet
    trigger: str | None = getattr(options, "level", None)
    settings = settings_from(rig.RecordSettings, options, sensor=sensor, level=None)
    stated: dict[str, Any] = {
        one.name: getattr(subject or SubjectOptions(), one.name) or "" for one in fields(rig.Subject)
    }
    speed: float | None = stated["speed"] or None
    staging = staging or StageOptions()
    strokes = staging.strokes(speed)
    stated["speed"] = "" if speed is None else f"{speed * 1e3:.6g}mm/s"
    if strokes is not None and (settings.duration is not None or trigger is not None):
        raise InputError("--stage: expected neither --duration nor --trigger; a take begins and ends with the stroke")
    touches = settings.duration if strokes is None else strokes.seconds
    device = rig.sensor_named(sensor, rig.VirtualRig(seed=settings.seed), duration=touches, wiring=settings.wiring)
    real_time = settings.real_time or strokes is not None
    ask = not (quiet or json) and (real_time or not device.on_demand)
    about = _subject(sensor, rig.Subject(**stated), ask=ask)
    rig.take_path(output, about, repeats=settings.repeats)
    if strokes is None and sensor.startswith("virtual:") and settings.duration is None:
        settings = settings.but(duration=0.5 if "am-" in sensor else 1.28)
    ends = settings.duration is not None or device.on_demand
    device = devices.WrappedSensor(device, paced=True) if real_time and device.on_demand else device
    with ExitStack() as held, signals_noted() as signals, Keys() as keys:
        takes: list[rig.Take] = []
        screen = MeterScreen(held.enter_context(device), err(), keys, signals, quiet=quiet)
        if trigger is not None:
            settings = settings.but(level=_level(trigger, device))
        if strokes is not None:
            strokes.stopped = lambda: bool(signals.came)
            held.enter_context(strokes)
            if staging.home:
                err().print(f"{strokes.stage.name}: homing now; the stage moves")
                strokes.stage.home(strokes.stopped)
        by_itself = strokes is not None or (ends and (settings.repeats == 1 or settings.pause is not None))
        key = keys.active and not by_itself and trigger is None
        try:
            for take in _takes(device, screen, settings, output, about, strokes, key=key):
                takes.append(take)
                if take.frames and not json:
                    lost = f"{take.lost} frames lost" if take.lost else "none lost"
                    answer = f"{duration_text(device.grid, take.frames, device.rate, about.object)}, {lost}"
                    print_table(describe_take(take, device), answer=answer, simulated=device.simulated, json=False)
        finally:
            if json:
                print_json([plain(describe_take(take, device)) for take in takes if take.frames])
        # A signal in a pause between takes: the last take is complete, the remaining ones are missing.
        if signals.came and takes[-1].end != "kill" and len(takes) < settings.repeats:
            err().print(f"midair: stopped; kept {len(takes)} of {settings.repeats} takes")
            return 130
        return _status(takes, device)


def _takes(
    device: devices.SensorDevice,
    screen: MeterScreen,
    settings: rig.RecordSettings,
    output: Path | None,
    about: rig.Subject,
    strokes: rig.StageStrokes | None,
    *,
    key: bool,
) -> Generator[rig.Take]:
    """Record the takes and yield each when it ends; a motion stage returns to the start after each."""
    many, kind = settings.repeats, "take" if strokes is None else "stroke"
    waits = key or settings.level is not None
    if strokes is not None:
        err().print(strokes.plan(many))
        if not screen.asks("space or Enter: go"):
            raise DeviceError("ended before the first stroke: nothing moved and nothing was recorded")
        _to_start(strokes, screen)
    for number in range(1, many + 1):
        path = rig.take_path(output, about, repeats=many)
        noted = ({} if strokes is None else strokes.settings) | (
            {"take": number, "takes": many} if many > 1 or strokes is not None else {}
        )
        with screen.take(f"{path.name}, {kind} {number} of {many}" if many > 1 or strokes else path.name):
            take = rig.record_take(
                device, settings, screen, strokes, path=path, notes=about.notes, about=noted, key=key
            )
        yield take
        if take.end in ("quit", "kill", "failure") if strokes is None else take.end != "stroke":
            if strokes is not None and take.end != "failure":
                err().print(f"the stage stands at {strokes.stage.stands}")
            return
        if strokes is not None:
            _to_start(strokes, screen)
        if number < many and not waits and not _wait_pause(settings, device, screen, staged=strokes is not None):
            return


def _to_start(strokes: rig.StageStrokes, screen: MeterScreen) -> None:
    """Move the stage to the start of a stroke; KeyboardInterrupt if it was stopped on the way."""
    if not strokes.to_start(screen.ends):
        err().print(f"the stage stands at {strokes.stage.stands}")
        raise KeyboardInterrupt


def _wait_pause(
    settings: rig.RecordSettings, device: devices.SensorDevice, screen: MeterScreen, *, staged: bool
) -> bool:
    """Wait for the pause; False if a key or a signal ends the session."""
    pause = settings.pause if settings.pause is not None else 0.0 if device.on_demand or staged else 2.0
    end = time.monotonic() + pause
    while (left := end - time.monotonic()) > 0:
        if screen.order() in ("quit", "kill"):
            return False
        time.sleep(min(0.05, left))
    return True


def _level(text: str, device: devices.SensorDevice) -> float:
    try:
        return parse_quantity(text, device.unit)
    except ValueError as wrong:
        raise InputError(f"--trigger: {wrong}; {device.name} gives {device.unit}") from None


def _subject(sensor: str, stated: rig.Subject, *, ask: bool) -> rig.Subject:
    """Notes on the object: as given, from the name of a virtual sensor, or from questions on the terminal."""
    kind, _, rest = sensor.partition(":")
    if kind == "virtual" and not stated.object:
        name, _, surface = rest.partition("+")
        return replace(stated, object=name, surface=stated.surface or surface)
    console = err()
    if not (ask and console.is_terminal and sys.stdin.isatty()):
        return stated
    before = rig.last_subject().notes
    said = asdict(stated)
    for name in [name for name, value in said.items() if not value]:
        default = before.get(name, "")  # Enter keeps the last answer
        asked = f"{name} [{default}]: " if default else f"{name}: "
        said[name] = console.input(asked, markup=False).strip() or default
    about = rig.Subject(**said)
    rig.store_subject(about)
    return about


def _status(takes: list[rig.Take], device: devices.SensorDevice) -> int:
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


def describe_take(take: rig.Take, device: devices.SensorDevice) -> list[Line]:
    """A take with its problems, and with its strokes if a motion stage moved the object."""
    levels, rate, low, high = take.levels, device.rate, take.lowest, take.highest
    full = "" if device.full_scale is None else f" of {device.full_scale:.3g} {device.unit} full scale"
    loudest = f"{max(abs(low), abs(high)):.3g} {device.unit}{full}, in cell {int(levels.highest.argmax())}"
    # The events of the recording are in its file, which a full disk may keep from being opened.
    life = Provenance() if take.path is None or take.error else files.open_take(take.path).recording.provenance
    return [
        Row("file", str(take.path), key="recording"),
        {"frames": take.frames, "rate_hz": rate, "lost_frames": take.lost, "end": take.end},
        Row("loudest", [low, high], key="range", text=loudest),
        {
            "clipped_channels": levels.clipped.nonzero()[0].tolist(),
            "dead_channels": levels.dead.nonzero()[0].tolist(),
            "stuck_channels": levels.stuck.nonzero()[0].tolist(),
            "rate_ppm": None if take.rate is None else take.rate.ppm,
            "clock_ppm": None if take.clock is None else take.clock.ppm,
        },
        *rig.take_problems(take, rate),
        calibration_row(device.calibration, take.path),
        *([] if device.calibration is None else [next_row("solve", take.path)]),
        Details([("sensor", sensor_text(device.grid)), *describe_strokes(life, rate)]),
    ]
