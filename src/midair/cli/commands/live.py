"""The command `live`: play the signal of a sensor in real time."""

import sys
from contextlib import nullcontext
from pathlib import Path

from rich.live import Live as Screen
from rich.text import Text

from midair.cli.console import banner, err, print_note, print_rows, verbosity
from midair.cli.exposure_options import AirOptions, ExposureOptions, HeatOptions, print_air
from midair.cli.keys import Signals, signals_noted
from midair.cli.options import Json, StopInput, options_from, settings_from
from midair.cli.output import may_write, print_table
from midair.devices import stop_on_input
from midair.errors import InputError
from midair.model import Acoustics, Medium
from midair.rig import LiveSession, LiveSettings, LiveStatistics, SensorRate
from midair.rig import live as begin
from midair.table import Line, Row

WRONG_RATE = 0.05
"""Relative deviation of the sensor's rate beyond which the command ends with status 1."""


@options_from(LiveSettings)
class LiveOptions(ExposureOptions):
    """Sensor, array, and the processing between them."""

    def settings(self, room: Medium | None = None) -> LiveSettings:
        """The settings that these options describe, in the stated air of the room."""
        air = None if room is None else Acoustics(medium=room)
        return settings_from(LiveSettings, self, acoustics=air, exposure=self.choices(room))


def live_command(
    *,
    options: LiveOptions | None = None,
    heat: HeatOptions | None = None,
    air: AirOptions | None = None,
    keep: Path | None = None,
    stop_input: StopInput = None,
    json: Json = False,
) -> int:
    """Play the pressure on a sensor in real time, 13 ms later; with --latency later and better.

    Suited to strokes; the delay of a tap is noticeable.
    The exposure check covers the worst case at the chosen level. The level rises over the first second.
    Frames that arrive too late are not played; without new frames the array becomes silent.
    Ctrl-C ends it, and so does midair stop in another terminal.

    Parameters
    ----------
    air
        Air of the room. [default: 22C, 50%]
    keep
        Record the session to this NAME.h5: calibrated pressure and drive. Existing files are not overwritten.
    json
        Print the result as JSON: frames, lost, late, latency in ms, and more.

    Examples
    --------
    $ midair live --duration 2s
    $ midair live --sensor virtual:sponge --duration 2s --keep felt.h5 --json
    $ midair live --latency 200ms --duration 2s
    $ midair live --device autd3 --follow leap: --tracker-latency 12ms
    $ midair live --sensor "lsl:Skin?unit=V" --calibration skin.calibration.h5 --device autd3 --level 0.3
    """
    air = air or AirOptions()
    room = air.medium()
    settings = (options or LiveOptions()).settings(room)
    if keep is not None:
        if keep.exists():
            raise InputError(f"{keep}: already exists; give another name")
        may_write(keep, True, ".h5")
    cooling = (heat or HeatOptions()).cooling()
    with (
        signals_noted() as signals,
        stop_on_input(stop_input),
        begin(settings=settings, cooling=cooling, keep=keep, report=print_note) as session,
    ):
        if not json:
            banner(session.opened.simulated)
            print_rows(_session_rows(session))
        print_air(settings.acoustics.medium, stated=room is not None)
        _watch(session, signals, quiet=json)
        ended = session
    simulated = ended.opened.simulated if json else None  # printed above
    print_table(_ended_table(ended, keep), json=json, simulated=simulated)
    if abs(ended.statistics.rate_error) > WRONG_RATE:
        return 1
    # Without a duration Ctrl-C is the normal end.
    if not signals.came or settings.duration is None:
        return 0
    err().print(f"midair: stopped; {'nothing was written' if keep is None else f'kept {keep}'}")
    return 130


def _ended_table(ended: LiveSession, keep: Path | None) -> list[Line]:
    counts, opened = ended.statistics, ended.opened
    return [
        {**counts.plain(), "error_by_band": _by_band(ended)},
        {"exposure": opened.exposure, "array_calibration": opened.array_calibration},
        {"computer": opened.granted.words(), "rehearsal": opened.rehearsal.words()},
        *_statistics_rows(counts),
        *([] if keep is None else [Row("take", str(keep))]),
    ]


def _rate_warning(rate: SensorRate, warned: bool) -> bool:
    """Print once that a sensor's rate is wrong; return whether this was done."""
    if rate.rate_problem and not warned:
        err().print(f"midair: {rate.rate_problem}", soft_wrap=True)
        return True
    return warned


def _watch(session: LiveSession, signals: Signals, *, quiet: bool) -> None:
    """Wait for the end, with a status line if stderr is a terminal."""
    shown = not quiet and not verbosity().quiet and sys.stderr.isatty()
    warned = False
    with Screen(console=err(), refresh_per_second=10, transient=True) if shown else nullcontext() as screen:
        while session.wait(0.1) and not signals.came:
            counts = session.statistics
            if screen is not None:
                parts = " + ".join(f"{name} {1e3 * part:.3g}" for name, part in counts.parts.items())
                seen = f"{counts.frames} frames, {counts.lost} lost, {counts.late} late"
                screen.update(Text(f"{seen}   {1e3 * counts.latency:.3g} ms = {parts} ms"))
            warned = _rate_warning(counts, warned)


def _by_band(session: LiveSession) -> dict[str, float]:
    opened = session.opened
    return {f"{low:g}-{high:g} Hz": round(e, 4) for (low, high), e in zip(opened.parts, opened.error, strict=True)}


ALLOWED = "; it may play here: the array is simulated and emits no sound"
"""Only a device without sound plays after an exceeded check."""


def _session_rows(session: LiveSession) -> list[tuple[str, str]]:
    opened, order = session.opened, session.order
    grid = opened.sensor
    errors = ", ".join(f"{100 * error:.0f} % in {band}" for band, error in _by_band(session).items())
    return [
        ("sensor", f"{order.sensor}, {grid.rows} x {grid.columns} cells at {opened.rate:g} Hz"),
        ("array", f"{order.device}, {opened.transducers} transducers, silencer {opened.silencer}"),
        ("array calibration", opened.array_calibration or "none"),
        ("exposure", opened.exposure + ALLOWED * opened.exposure.startswith("exceeded")),
        ("level", f"{opened.level:.3g} of full drive, rising over the first second"),
        ("delay", " + ".join(f"{name} {1e3 * part:.3g} ms" for name, part in session.statistics.parts.items())),
        ("error of the filter", errors),
        ("computer", opened.granted.words()),
        ("rehearsal", opened.rehearsal.words()),
    ]


def _statistics_rows(counts: LiveStatistics) -> list[tuple[str, str]]:
    def times(shares: tuple[float, ...]) -> str:
        names = ("half", "99 %", "99.9 %", "all")
        return ", ".join(f"{name} within {1e3 * each:.3g}" for name, each in zip(names, shares, strict=True)) + " ms"

    worst = "; ".join(f"second {second}: {late} late, {lost} lost" for second, late, lost in counts.worst)
    tenths = "; ".join(f"{name} {' '.join(map(str, parts))}" for name, parts in counts.over_time.items())
    return [
        ("frames", f"{counts.frames}, {counts.played} of them played"),
        ("lost", f"{counts.lost} missing from the sensor, in {counts.gaps} gaps of 20 ms or more"),
        ("late", f"{counts.late}; {counts.hurried} solved in half the time, {counts.unanswered} without a solution"),
        ("too hot", f"{counts.hot} frames dropped while a unit was too hot" if counts.hot else ""),
        ("failsafe", f"silenced the units {counts.failsafe} times; the level rose again" if counts.failsafe else ""),
        ("latency", f"{1e3 * counts.latency:.3g} ms from skin to skin"),
        ("sent after they were taken", times(counts.left)),
        ("work on a frame", times(counts.work)),
        ("worst seconds", worst),
        ("by tenths of the run", tenths if counts.worst or counts.gaps else ""),
        ("rate", counts.rate_problem),
    ]
