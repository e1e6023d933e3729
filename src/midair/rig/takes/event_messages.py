"""Messages for the events of a take."""

from midair.model import Event, SensorGrid
from midair.rig.takes.clocks import Drift
from midair.rig.takes.take_state import Take


def event_message(event: Event, rate: float, grid: SensorGrid, drift: Drift | None = None) -> str:
    """One sentence for an event of a sensor with `rate` frames per second."""
    channel = f"channel {event.channel} ({_cell_name(event.channel, grid)})"
    words = {
        "lost": _lost(event, rate),
        "clipped": f"{channel} clips: reduce its gain, or press less",
        "dead": f"{channel} is dead: it has never changed; check its wire",
        "stuck": f"{channel} is stuck: it changed before; check its wire",
        "rate": f"frames come {_drift(event.ppm, drift)} than {rate:g} a second, by this computer's clock",
        "clock": f"the sensor's clock runs {_drift(event.ppm, drift)} than this computer's",
        "trigger": "touched",
        "stroke": f"a stroke of {event.frames / rate:.3f} s",
        "mended": f"{event.frames} missing frames of {channel} were filled",
        "late": f"{event.frames} frames of live touch were not played in time",
    }
    return f"{event.frame / rate:.3f} s: {words[event.kind]}"


def take_problems(take: Take, rate: float) -> list[tuple[str, str]]:
    """Problems of a take as (name, value) pairs; empty for a good take."""
    levels = take.levels
    rows: list[tuple[str, str]] = []
    if take.lost:
        share = 100 * take.lost / max(1, take.frames)
        rows.append(("lost", f"{take.lost} frames ({share:.2g} %), replaced by the last good one; the file lists them"))
    for name, channels in (("clipped", levels.clipped > 0), ("dead", levels.dead), ("stuck", levels.stuck)):
        if channels.any():
            rows.append((f"{name} channels", ", ".join(str(i) for i in channels.nonzero()[0])))
    for name, drift in (("frames per second", take.rate), ("sensor's clock", take.clock)):
        if drift is not None and drift.certain:
            actual = f"{rate * (1 + drift.ppm * 1e-6):.7g} Hz, " if name == "frames per second" else ""
            rows.append((name, f"{actual}{drift.ppm:+.3g} ± {drift.uncertainty:.2g} ppm against this computer's"))
    if take.problem:
        rows.append(("ended by", take.problem))
    return rows


def _lost(event: Event, rate: float) -> str:
    if event.frames == 0:
        return (
            "frames may be missing: the sensor lost an unknown number, or its time stamps jumped; later times are "
            "uncertain"
        )
    return f"{event.frames} frames ({1e3 * event.frames / rate:.4g} ms) were lost; the last good one is repeated"


def _cell_name(channel: int, grid: SensorGrid) -> str:
    row, column = divmod(max(channel, 0), grid.columns)
    return f"row {row}, column {column}"


def _drift(ppm: float, drift: Drift | None) -> str:
    spread = "" if drift is None else f" ± {drift.uncertainty:.2g}"
    return f"{abs(ppm):.4g}{spread} ppm {'faster' if ppm > 0 else 'slower'}"
