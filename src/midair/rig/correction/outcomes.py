"""What came of a loop, beside what came of another: the verdict in one sentence, the figures, the picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from midair.errors import ShapeError
from midair.evaluate import PalmFidelity, PerceptualMetrics, perceptual_metrics
from midair.figures import PalmPanel, Picture, palm_figure, png
from midair.rig.correction.correction_loop import Loop
from midair.targets import piece_of

Row = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What came of one way of playing.

    Attributes
    ----------
    name : str
        Of the way, such as "best mode".
    loop : Loop
        Its loop.
    palm : PalmFidelity or None
        What a whole palm gets of the last pass, where that was simulated.
    card : PerceptualCard or None
        What skin makes of the last pass; None where it is shorter than the 64 ms that its metrics need.
    """

    name: str
    loop: Loop
    palm: PalmFidelity | None
    card: PerceptualMetrics | None

    @classmethod
    def of(cls, loop: Loop, *, palm: PalmFidelity | None = None, name: str = "") -> "Outcome":
        """With its card filled in."""
        return cls(name=name, loop=loop, palm=palm, card=metrics_of_loop(loop))

    @property
    def distortion(self) -> float:
        """Signal over distortion on the sensor's cells, in dB."""
        return self.loop.passes[-1].comparison.distortion_ratio

    def numbers(self, *, named: bool = True) -> str:
        """Signal over distortion, and how much presses beside what the sensor covers; what each is only if `named`."""
        heard = f"{self.distortion:.1f} dB{' of signal to distortion' if named else ''}"
        if self.palm is None:
            return heard
        return (
            f"{heard} and {100 * self.palm.outside:.0f} %{' of the power beside the recorded square' if named else ''}"
        )


def metrics_of_loop(loop: Loop) -> PerceptualMetrics | None:
    """The perceptual card of the last pass; None where it is shorter than the 64 ms that its metrics need."""
    try:
        return perceptual_metrics(loop.reference, loop.passes[-1].felt)
    except ShapeError:
        return None


def verdict(outcomes: Sequence[Outcome]) -> str:
    """One sentence: what a palm would feel of the first, and how that is beside the others.

    Of a piece too short for a card only the numbers are told.
    """
    first, *others = outcomes
    said = "; ".join([_sentence(first), *(_sentence(other, named=False) for other in others)])
    by = "" if first.card is None else f"; {first.card.reservation()}"
    return f"{said[:1].upper()}{said[1:]}{by}."


def _sentence(outcome: Outcome, *, named: bool = True) -> str:
    where, numbers = f"in {outcome.name} " if outcome.name else "", outcome.numbers(named=named)
    if outcome.card is None:
        return f"{where}{numbers}"
    return f"{where}{'a palm' if named else 'it'} would {outcome.card.felt()}, at {numbers}"


def side_by_side(outcomes: Sequence[Outcome]) -> list[Row]:
    """Rows of name, unit, and the value of each."""
    columns = [_figures(outcome) for outcome in outcomes]
    return [(name, unit, *(column[name][0] for column in columns)) for name, (_, unit) in columns[0].items()]


def palm_picture(outcomes: Sequence[Outcome]) -> Picture | None:
    """Where each presses on a palm, and the strongest cell of each; None where no palm was simulated."""
    ways = [
        PalmPanel(name=each.name or "reproduced", felt=each.loop.passes[-1].felt, pressed=each.palm.pressed)
        for each in outcomes
        if each.palm is not None and each.palm.pressed is not None
    ]
    if not ways:
        return None
    return Picture(
        title="What reaches a palm",
        caption="Above, how hard it vibrates on each point of a palm; the dashed square is what the sensor covers. "
        "Below, the cell that was pressed hardest, around its strongest moment.",
        data=png(palm_figure(outcomes[0].loop.original, ways)),
    )


def _figures(outcome: Outcome) -> dict[str, tuple[str, str]]:
    last, palm, card = outcome.loop.passes[-1], outcome.palm, outcome.card
    made = last.reproduction
    inside = piece_of(made.target.provenance, made.target.frames, made.target.rate)
    rows = {"signal to distortion on the sensor": (f"{outcome.distortion:.1f}", "dB")}
    if palm is not None:
        low, high = palm.range
        rows["signal to distortion of the skin's movement"] = (f"{low:.1f} to {high:.1f}", "dB")
        rows["leak: power beside the recorded square"] = (f"{100 * palm.outside:.1f}", "%")
    rows["gain"] = (f"{last.comparison.gain:.2f}", "")
    if card is not None:
        levels = [card.figure(f"Pacinian power, {which}").overall for which in ("original", "reproduced")]
        rows["what is felt"] = (f"a palm would {card.felt()}", "")
        rows["felt vibration over the threshold, of the original and of this"] = (
            " and ".join(f"{level:.1f}" for level in levels),
            "dB",
        )
        rows["felt spectrum alike (SPQI)"] = (f"{card.figure('SPQI').overall:.2f}", "")
    rows["E of what is met, mean"] = (f"{100 * float(np.mean(made.solution.error[inside])):.1f}", "%")
    solver = outcome.loop.settings.solver
    rows["solver, frames"] = (f"{solver.name}, {made.target.frames} at {made.target.rate:g} Hz", "")
    return rows
