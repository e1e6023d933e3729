"""Compare the outcomes of loops: a verdict on each, a table, a figure of the palm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from midair.evaluate import (
    PalmFidelity,
    PerceptualMetrics,
    Verdict,
    metrics_or_none,
    ratio_text,
)
from midair.figures import PalmPanel, Picture, palm_figure, png_bytes
from midair.rig.correction.correction_loop import Loop
from midair.settings import Settings
from midair.targets import frames_without_lead

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


PALM_TITLE = "Vibration on a palm"
"""Title of the picture of a palm."""


def palm_picture(outcomes: Sequence[Outcome]) -> Picture | None:
    """Figure of the pressure of each outcome on a palm, and of its strongest cell; None without a simulated palm."""
    ways = [
        PalmPanel(name=each.name or "reproduced", felt=each.loop.passes[-1].felt, pressed=each.palm.pressed)
        for each in outcomes
        if each.palm is not None and each.palm.pressed is not None
    ]
    if not ways:
        return None
    return Picture(
        title=PALM_TITLE,
        caption="Top: vibration at each point of a palm; the dashed square is the area of the sensor. "
        "Bottom: the cell with the highest pressure, around its maximum.",
        data=png_bytes(palm_figure(outcomes[0].loop.original, ways)),
    )


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
