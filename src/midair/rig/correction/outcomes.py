"""Compare the outcomes of loops: a verdict on each, a table, maps of the palm."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.evaluate import PalmFidelity, PerceptualMetrics, Verdict, metrics_or_none, ratio_text
from midair.figures import STYLE, map_source
from midair.model import PressureFrames, frames_without_lead
from midair.rig.correction.correction_loop import Loop
from midair.settings import Settings

Row = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """Result of one way of playing."""

    name: str
    """Name of the way, such as "best mode"."""
    loop: Loop
    palm: PalmFidelity | None
    """Fidelity of the last pass on a simulated palm."""
    card: PerceptualMetrics | None
    """Perceptual metrics of the last pass; None if it is shorter than the 64 ms that they need."""
    verdict: Verdict
    """The answer in a few lines."""

    @classmethod
    def of(cls, loop: Loop, *, palm: PalmFidelity | None = None, name: str = "") -> "Outcome":
        """Build an outcome with its perceptual metrics and its verdict."""
        last = loop.passes[-1]
        card = metrics_or_none(loop.reference, last.felt)
        option = next_step(last.comparison.gain, loop.settings)
        verdict = Verdict.of(last.comparison, last.felt, card, option=option)
        return cls(name=name, loop=loop, palm=palm, card=card, verdict=verdict)


def comparison_rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """Rows of name, unit, and the value of each outcome."""
    columns = [_figures(outcome) for outcome in outcomes]
    # Only the first way is judged in a laboratory.
    return [(name, unit, *(each.get(name, ("",))[0] for each in columns)) for name, (_, unit) in columns[0].items()]


def next_step(gain: float, settings: Settings | None) -> str:
    """Option of `midair solve` that corrects a level of `gain` times the original's; empty within 5 %."""
    if settings is None or not 0.05 < gain < 20 or abs(gain - 1) < 0.05:
        return ""
    target = settings.target
    # Pressure is proportional to the square of the strength.
    if target.strength is None:
        return f"--gain {target.gain / gain:.3g}"
    return f"--strength {target.strength / np.sqrt(gain):.2g}"


def palm_maps(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Maps of the vibration, target first and then each outcome, on one scale that shows the first two; for a page.

    On a simulated palm if there is one, on the cells of the sensor otherwise. Lengths are in mm.
    """
    first, sensor = outcomes[0], outcomes[0].loop.original.sensor
    pressed = None if first.palm is None else first.palm.pressed
    if pressed is None:
        half = [500 * sensor.pitch * count for count in (sensor.columns, sensor.rows)]
        square, note = half, "Root mean square of the pressure on each cell."
        maps = [_rms(first.loop.original), *(_rms(each.loop.passes[-1].felt) for each in outcomes)]
    else:
        half = [500 * pressed.pitch * count for count in pressed.wanted.shape[::-1]]
        square = [1e3 * each for each in pressed.square]
        note = "The vibration at each point of a simulated palm, a disc of 85 mm: root mean square of the pressure."
        maps = [pressed.wanted, *(each.palm.pressed.delivered for each in outcomes if each.palm and each.palm.pressed)]
    top = max(float(np.nanmax(each)) for each in maps[:2]) or 1.0
    names = ["original", *(each.name or "re-recorded" for each in outcomes)]
    notes = ["as recorded", *(_beside(each) for each in outcomes)]
    sources = [map_source(each, top) for each in maps]
    shown = list(zip(names, notes, sources, strict=True))
    more = float(np.nanmax(maps[-1]))
    note += f" The darkest colour is {top:.2g} Pa and more, up to {more:.2g} Pa." if more > 1.1 * top else ""
    return {"maps": shown, "half": half, "square": square, "top": f"{top:.2g}", "note": note, "ramp": STYLE.touch} | {
        "width": f"{2 * square[0]:.0f}"
    }


def _rms(frames: PressureFrames) -> Array:
    return np.sqrt((frames.pressure**2).mean(axis=0))


def _beside(outcome: Outcome) -> str:
    alike = dict(outcome.verdict.rows())["alike"].partition(":")[0]
    return alike if outcome.palm is None else f"{alike}; {100 * outcome.palm.outside:.0f} % of the power beside it"


def _figures(outcome: Outcome) -> dict[str, tuple[str, str]]:
    last, palm = outcome.loop.passes[-1], outcome.palm
    made = last.reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    rows = {name: (ratio_text(limits), "dB") for name, limits in last.comparison.ratios.items()}
    if palm is not None:
        low, high = palm.range
        rows["signal to distortion of the skin's movement"] = (f"{low:.1f} to {high:.1f}", "dB")
        rows["leak: power beside the recorded square"] = (f"{100 * palm.outside:.1f}", "%")
    rows |= {name: (text, "") for name, text in outcome.verdict.rows()}
    # A silent frame has the error 0.
    error = made.solution.error[inside][made.solution.plays[inside]]
    rows["E as the solver measures it, mean"] = (f"{100 * float(error.mean()) if len(error) else 0.0:.1f}", "%")
    solver = outcome.loop.settings.solver
    rows["solver, frames"] = (f"{solver.name}, {made.target.frames} at {made.target.rate:g} Hz", "")
    return rows
