"""The command `live`: play the signal of a sensor in real time."""

import sys
import time
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin, get_type_hints

from cyclopts import Parameter
from rich.live import Live as Screen
from rich.text import Text

from midair.cli.console import banner, err, print_json, print_rows, verbosity
from midair.cli.exposure_options import AirOptions, ExposureOptions, HeatOptions, air_watched, print_air
from midair.cli.keys import Signals, signals_noted
from midair.cli.options import Json, StopInput
from midair.cli.output import may_write
from midair.cli.quantities import quantity
from midair.devices import stop_on_input
from midair.errors import InputError
from midair.model import Acoustics, Medium
from midair.rig import LiveSession, LiveSettings, LiveStatistics, make_key, send_touch
from midair.rig import live as begin

WRONG_RATE = 0.05
"""Relative deviation of the sensor's rate beyond which the command ends with status 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _LiveOptions(ExposureOptions):
    """Exposure limits, beside the options made from `LiveSettings`."""

    def settings(self, room: Medium | None = None) -> LiveSettings:
        """The settings that these options describe, in the stated air of the room."""
        air = None if room is None else Acoustics(medium=room)
        given = {one.name: getattr(self, one.name) for one in fields(LiveSettings) if hasattr(self, one.name)}
        return LiveSettings().but(**given, acoustics=air, exposure=self.choices(room))


def _options() -> Any:
    """A dataclass with an option for each field of `LiveSettings` that can be typed."""
    hints, made = get_type_hints(LiveSettings), list[Any]()
    for one in fields(LiveSettings):
        told = one.metadata
        name = told.get("option", one.name)
        if not name:
            continue
        said: list[Any] = [Parameter(name=f"--{name}", help=told["help"])]
        if told["unit"]:
            said.append(quantity(told["unit"], many=2 if get_origin(hints[one.name]) is tuple else None))
        kind: Any = Path | None if "load" in told else hints[one.name]
        made.append((one.name, Annotated[kind, *said], field(default=one.default)))
    about = {"__doc__": "Sensor, array, and the processing between them.", "__module__": __name__}
    return make_dataclass("LiveOptions", made, bases=(_LiveOptions,), frozen=True, kw_only=True, namespace=about)


if TYPE_CHECKING:

    class LiveOptions(_LiveOptions):
        """Sensor, array, and the processing between them."""

else:
    LiveOptions = Parameter(name="*")(_options())


def live_command(
    *,
    options: LiveOptions | None = None,
    heat: HeatOptions | None = None,
    air: AirOptions | None = None,
    to: str | None = None,
    new_key: Path | None = None,
    keep: Path | None = None,
    stop_input: StopInput = None,
    json: Json = False,
) -> int:
    """Play the pressure on a sensor in real time, 13 ms later.

    Suited to strokes; the delay of a tap is noticeable.
    The exposure check covers the worst case at the chosen level. The level rises over the first second.
    Frames that arrive too late are not played; without new frames the array becomes silent.
    Ctrl-C ends it, and so does midair stop in another terminal.

    Parameters
    ----------
    air
        Air of the room. [default: 22C, 50%]
    to
        Send the sensor's frames to HOST:PORT; nothing plays on this computer. Needs --key.
    new_key
        Create a key file and exit.
    keep
        Record the session to this NAME.h5: calibrated pressure and drive. Existing files are not overwritten.
    json
        Print the result as JSON: frames, lost, late, latency in ms, and more.

    Examples
    --------
    $ midair live --duration 2s
    $ midair live --sensor virtual:sponge --duration 2s --keep felt.h5 --json
    $ midair live --new-key touch.key
    $ midair live --listen 0.0.0.0:5005 --key touch.key --device autd3
    $ midair live --to lab.example:5005 --key touch.key --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5
    $ midair live --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5 --device autd3 --level 0.3
    """
    if new_key is not None:
        make_key(new_key)
        print_rows([("key", f"{new_key}; copy it to the other computer, and keep it secret")])
        return 0
    air = air or AirOptions()
    room = air.medium()
    settings = (options or LiveOptions()).settings(room)
    if to is not None:
        _send(settings, to, json=json)
        return 0
    if keep is not None:
        if keep.exists():
            raise InputError(f"{keep}: already exists; give another name")
        may_write(keep, True, ".h5")
    cooling = (heat or HeatOptions()).cooling()
    watched = air_watched(
        air.temperature,
        settings.acoustics.medium,
        advice="start live again to solve for this air",
        device="" if settings.device == "virtual" else settings.device,
    )
    with (
        signals_noted() as signals,
        stop_on_input(stop_input),
        begin(settings=settings, cooling=cooling, keep=keep) as session,
        watched,
    ):
        if not json:
            banner(session.opened.simulated)
            print_rows(_session_rows(session))
        print_air(settings.acoustics.medium, stated=room is not None)
        _watch(session, signals, quiet=json)
        ended = session
    _print_result(ended, keep, json=json)
    if abs(ended.statistics.rate_error) > WRONG_RATE:
        return 1
    # Without a duration Ctrl-C is the normal end.
    if not signals.came or settings.duration is None:
        return 0
    err().print(f"midair: stopped; {'nothing was written' if keep is None else f'kept {keep}'}")
    return 130


def _print_result(ended: LiveSession, keep: Path | None, *, json: bool) -> None:
    counts = ended.statistics
    if json:
        opened = ended.opened
        beside = {"simulated": opened.simulated, "exposure": opened.exposure, "computer": opened.granted.words()}
        kept = {} if keep is None else {"take": str(keep)}
        return print_json(counts.plain() | {"error_by_band": _by_band(ended), "network": ended.network} | beside | kept)
    print_rows([*_statistics_rows(counts), *_network_rows(ended), *([] if keep is None else [("take", str(keep))])])
    return None


def _send(settings: LiveSettings, to: str, *, json: bool) -> None:
    """Send a sensor's frames to the other computer; nothing plays here."""
    if settings.key is None or settings.listen is not None:
        raise InputError("--to: expected --key with the shared key file, and no --listen")
    duration = settings.duration
    with signals_noted() as signals, send_touch(settings.sensor, to, settings.key, settings=settings) as speaker:
        if not json:
            banner(speaker.greeting.simulated)
        until = None if duration is None else time.monotonic() + duration
        speaker.run(lambda: not signals.came and (until is None or time.monotonic() < until))
    spoken = asdict(speaker.spoken)
    if json:
        return print_json(spoken | {"simulated": speaker.greeting.simulated})
    return print_rows([(name, str(count)) for name, count in spoken.items()])


def _watch(session: LiveSession, signals: Signals, *, quiet: bool) -> None:
    """Wait for the end, with a status line if stderr is a terminal."""
    shown = not quiet and not verbosity().quiet and sys.stderr.isatty()
    warned = False
    with Screen(console=err(), refresh_per_second=10, transient=True) if shown else _NoScreen() as screen:
        while session.wait(0.1) and not signals.came:
            counts = session.statistics
            screen.update(Text(_status_line(counts)))
            if counts.rate_problem and not warned:
                warned = True
                err().print(f"midair: {counts.rate_problem}", soft_wrap=True)


class _NoScreen:
    """Replacement for the status line that shows nothing."""

    def __enter__(self) -> "_NoScreen":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def update(self, _: Text) -> None:
        """Ignore the text."""


def _status_line(counts: LiveStatistics) -> str:
    parts = " + ".join(f"{name} {1e3 * part:.3g}" for name, part in counts.parts.items())
    return (
        f"{counts.frames} frames, {counts.lost} lost, {counts.late} late   {1e3 * counts.latency:.3g} ms = {parts} ms"
    )


def _by_band(session: LiveSession) -> dict[str, float]:
    opened = session.opened
    return {f"{low:g}-{high:g} Hz": round(e, 4) for (low, high), e in zip(opened.parts, opened.error, strict=True)}


def _session_rows(session: LiveSession) -> list[tuple[str, str]]:
    """Rows to print before the array plays."""
    opened, order = session.opened, session.order
    grid = opened.sensor
    errors = ", ".join(f"{100 * error:.0f} % in {band}" for band, error in _by_band(session).items())
    return [
        ("sensor", f"{order.sensor}, {grid.rows} x {grid.columns} cells at {opened.rate:g} Hz"),
        ("array", f"{order.device}, {opened.transducers} transducers, silencer {opened.silencer}"),
        ("exposure", opened.exposure),
        ("level", f"{opened.level:.3g} of full drive, rising over the first second"),
        ("delay", " + ".join(f"{name} {1e3 * part:.3g} ms" for name, part in session.statistics.parts.items())),
        ("error of the filter", errors),
        ("computer", opened.granted.words()),
    ]


def _network_rows(session: LiveSession) -> list[tuple[str, str]]:
    """Counts of the network receiver; no rows without one."""
    counts = session.network
    if not counts:
        return []
    said = f"{counts['frames']} frames, {counts['concealed']} concealed, {counts['tardy']} of them arrived too late"
    return [("network", f"{said}; {counts['repeated']} duplicates and {counts['refused']} other packets dropped")]


def _worst(counts: LiveStatistics) -> str:
    return "; ".join(f"second {second}: {late} late, {lost} lost" for second, late, lost in counts.worst)


def _statistics_rows(counts: LiveStatistics) -> list[tuple[str, str]]:
    def times(shares: tuple[float, ...]) -> str:
        names = ("half", "99 %", "99.9 %", "all")
        return ", ".join(f"{name} within {1e3 * each:.3g}" for name, each in zip(names, shares, strict=True)) + " ms"

    return [
        ("frames", f"{counts.frames}, {counts.played} of them played"),
        ("lost", f"{counts.lost} missing from the sensor, in {counts.gaps} gaps of 20 ms or more"),
        ("late", f"{counts.late}; {counts.hurried} solved in half the time, {counts.unanswered} without a solution"),
        *([("too hot", f"{counts.hot} frames dropped while a unit was too hot")] if counts.hot else []),
        ("latency", f"{1e3 * counts.latency:.3g} ms from skin to skin"),
        ("sent after they were taken", times(counts.left)),
        ("work on a frame", times(counts.work)),
        *([("worst seconds", _worst(counts))] if counts.worst else []),
        *([("rate", counts.rate_problem)] if counts.rate_problem else []),
    ]
