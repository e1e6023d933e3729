"""The command `live`: play the signal of a sensor in real time."""

import sys
from contextlib import nullcontext
from pathlib import Path

from rich.live import Live as Screen
from rich.text import Text

from midair.cli.console import err, print_note, verbosity
from midair.cli.exposure_options import HeatOptions, RoomOptions, print_air
from midair.cli.keys import Signals, signals_noted
from midair.cli.options import Json, StopInput, options_from, settings_from
from midair.cli.output import may_write, print_table
from midair.devices import stop_on_input
from midair.errors import InputError
from midair.model import Acoustics
from midair.rig import LiveSession, LiveSettings, LiveStatistics
from midair.rig import live as begin
from midair.table import Details, Line, Row

WRONG_RATE = 0.05
"""Relative deviation of the sensor's rate beyond which the command ends with status 1."""


@options_from(LiveSettings)
class LiveOptions(RoomOptions):
    """Sensor, array, and the processing between them, in the air of the room."""

    def settings(self) -> LiveSettings:
        """The settings that these options describe."""
        air = None if (room := self.medium()) is None else Acoustics(medium=room)
        return settings_from(LiveSettings, self, acoustics=air, exposure=self.limits())


def live_command(
    *,
    options: LiveOptions | None = None,
    heat: HeatOptions | None = None,
    keep: Path | None = None,
    stop_input: StopInput = None,
    json: Json = False,
) -> int:
    """Play the pressure on a sensor in real time, 13 ms later; a longer --latency improves it.

    Suited to strokes; the delay of a tap is noticeable.
    The exposure check covers the worst case at the chosen level. The level rises over the first second.
    Frames that arrive too late are not played; without new frames the array becomes silent.
    Ctrl-C ends it, and so does midair stop in another terminal.

    Parameters
    ----------
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
    options = options or LiveOptions()
    heat = heat or HeatOptions()
    settings = options.settings().but(cooling_limit=heat.cooling_limit if heat.when_hot == "wait" else None)
    if keep is not None:
        if keep.exists():
            raise InputError(f"{keep}: already exists; give another name")
        may_write(keep, True, ".h5")
    with (
        signals_noted() as signals,
        stop_on_input(stop_input),
        begin(settings=settings, keep=keep, report=print_note) as session,
    ):
        if not json:
            print_table(
                _session_lines(session),
                answer="touch is played as it comes; Ctrl-C ends it",
                simulated=session.opened.simulated,
                json=False,
            )
        print_air(settings.acoustics.medium, stated=options.temperature is not None)
        _watch(session, signals, quiet=json)
        ended = session
    counts = ended.statistics
    answer = f"{counts.frames} frames of touch, played {1e3 * counts.latency:.3g} ms later"
    simulated = json and ended.opened.simulated  # printed above
    print_table(_ended_table(ended, keep), answer=answer, json=json, simulated=simulated)
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
        {"computer": opened.granted, "rehearsal": opened.rehearsal.words()},
        *_statistics_lines(counts),
        *([] if keep is None else [Row("take", str(keep))]),
    ]


def _rate_warning(rate: LiveStatistics, warned: bool) -> bool:
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


def _session_lines(session: LiveSession) -> list[Line]:
    opened, order = session.opened, session.order
    grid, parts = opened.sensor, session.statistics.parts
    errors = ", ".join(f"{100 * error:.0f} % in {band}" for band, error in _by_band(session).items())
    return [
        ("sensor", f"{order.sensor}, {grid.rows} x {grid.columns} cells at {opened.rate:g} Hz"),
        ("array", f"{order.device}, {opened.transducers} transducers, silencer {opened.silencer}"),
        ("exposure", opened.exposure + ALLOWED * opened.exposure.startswith("exceeded")),
        ("delay", " + ".join(f"{name} {1e3 * part:.3g} ms" for name, part in parts.items())),
        ("blurred", f"error by the short delay: {errors}" if errors else ""),
        Details(
            [
                ("array calibration", opened.array_calibration or "none"),
                ("level", f"{opened.level:.3g} of full drive, rising over the first second"),
                ("computer", opened.granted),
                ("rehearsal", opened.rehearsal.words()),
            ]
        ),
    ]


def _statistics_lines(counts: LiveStatistics) -> list[Line]:
    def times(shares: tuple[float, ...]) -> str:
        names = ("half", "99 %", "99.9 %", "all")
        return ", ".join(f"{name} within {1e3 * each:.3g}" for name, each in zip(names, shares, strict=True)) + " ms"

    late, first = counts.late, sum(counts.over_time.get("late", ())[:1])
    lost = f"{counts.lost} of {counts.frames} frames missing from the sensor, in {counts.gaps} gaps of 20 ms or more"
    when = f", {first} of them in the first tenth" if first else ""
    return [
        ("late", f"{late} of {counts.frames} frames{when}: the frame before stayed" if late else "no frame"),
        ("lost", lost if counts.lost else ""),
        ("too hot", f"{counts.hot} frames dropped while a unit was too hot" if counts.hot else ""),
        ("failsafe", f"silenced the units {counts.failsafe} times; the level rose again" if counts.failsafe else ""),
        ("rate", counts.rate_problem),
        Details(
            [
                ("hurried", f"{counts.hurried} frames solved in half the time, {counts.unanswered} without an answer"),
                ("sent after they were taken", times(counts.left)),
                ("work on a frame", times(counts.work)),
            ]
        ),
    ]
