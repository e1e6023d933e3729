"""The verdict on a reproduction: at most six lines, in the same words wherever it is shown."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.evaluate.comparison import Comparison
from midair.evaluate.distortion import finite
from midair.evaluate.error_budget import ALL, ALL_MEASURED, LaboratoryLoss
from midair.evaluate.felt import Felt, felt
from midair.evaluate.place import Place
from midair.evaluate.skin_metrics import STEP, PerceptualMetrics
from midair.model import PressureFrames

SAME, SIMILAR = 14.0, 6.0
"""Signal to distortion in dB from which a reproduction is called the same (the difference is a fifth of the signal, the
just noticeable difference of its amplitude) and similar (a half); assumed, not tried on people."""

OTHER = 25.0
"""Share in % of the felt power at other frequencies from which it is another spectrum: half of the amplitude."""


def too_loud(excess: float) -> str:
    """The level at the ears above its limit in dB, in words."""
    return (
        f"{max(excess, 0.1):.{int(excess < 0.5)}f} dB too loud without protection" if excess > 0 else "within the limit"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How a reproduction is felt, how alike and how strong it is, and what a real laboratory and ears get."""

    felt: Felt
    """Level of the reproduction over the detection threshold."""
    fidelity: float
    """Signal to distortion on the touched cells in dB, without known noise of the sensor."""
    spectrum: float | None
    """Share in % of what is felt that lies at other frequencies than in the original; None for less than 64 ms."""
    place: Place
    """Where the pattern lies on the palm."""
    gain: float
    """Pressure of the reproduction over that of the original."""
    option: str = ""
    """Option of `midair solve` that corrects the level."""
    excess: float | None = None
    """Level at the ears above its limit, without protection, in dB; None if it was not computed."""
    laboratory: LaboratoryLoss | None = None
    """Loss in a real laboratory, if it was computed."""
    left_out: str = ""
    """Part of the recording that is not reproduced; empty if it is small or unknown."""

    @classmethod
    def of(
        cls, comparison: Comparison, reproduced: PressureFrames, card: PerceptualMetrics | None, **known: Any
    ) -> "Verdict":
        """Build the verdict from the figures of one reproduction; `known` are further fields of the class.

        Ears and the part that is left out are those in the provenance of the reproduction.
        """
        life = reproduced.provenance
        noted: Any = life.last("play").get("ears_excess_db"), life.last("not reproduced").get("text", "")
        return cls(
            felt=felt(reproduced.pressure, reproduced.rate, reproduced.sensor.pitch) if card is None else card.felt,
            fidelity=comparison.fidelity,
            spectrum=None if card is None else card.figure("other frequencies").overall,
            place=comparison.place,
            gain=comparison.gain,
            **dict(zip(("excess", "left_out"), noted, strict=True)) | known,
        )

    def rows(self) -> list[tuple[str, str]]:
        """Name and text of each line; only what is known."""
        lines = [("felt", str(self.felt)), ("alike", self._alike()), ("level", self._level())]
        if self.place:
            lines.append(("place", str(self.place)))
        if self.excess is not None:
            lines.append(("ears", too_loud(self.excess)))
        if self.laboratory is not None:
            lines.append(("laboratory", self.laboratory.text()))
        return [*lines, ("left out", self.left_out)] if self.left_out else lines

    def _alike(self) -> str:
        word = "the same" if self.fidelity >= SAME else "similar" if self.fidelity >= SIMILAR else "different"
        other = ", another spectrum" if self.spectrum is not None and self.spectrum > OTHER else ""
        return f"{word}{other}: {self.fidelity:.1f} dB on the touched cells"

    def _level(self) -> str:
        if self.gain <= 0:
            return "the original is not in it"
        times = abs(20 * float(np.log10(self.gain)))
        percent = round(100 * abs(self.gain - 1))
        share = f"{percent} % {'stronger' if self.gain > 1 else 'weaker'}"
        share = share if 0.5 <= self.gain <= 2 else f"{self.gain:.2g} times as strong"
        if times <= STEP:
            return f"as strong as the original ({share})" if percent else "as strong as the original"
        return f"{share}: solve with {self.option}" if self.option else share

    def plain(self) -> dict[str, object]:
        """Values for JSON: the lines by their names, and the figures behind them."""
        figures = {"felt": self.felt.plain(), "fidelity_db": finite(self.fidelity), "gain": self.gain}
        lab = {} if self.laboratory is None else self.laboratory.ratios
        medians = {name: float(np.median(lab[name])) for name in (ALL, ALL_MEASURED) if name in lab}
        return {"lines": dict(self.rows()), **figures, "ears_excess_db": self.excess, "laboratory_db": medians}

    def __str__(self) -> str:
        width = max(len(name) for name, _ in self.rows()) + 2
        return "\n".join(f"{name:{width}}{text}" for name, text in self.rows())


PROTECTION = 31.0
"""Attenuation in dB of the ear protection in the list of ways; a person states that of their own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One thing that a person may do about a drive that is too loud for the ears."""

    name: str
    felt: Felt | None
    """The people who then feel it; None if that needs another solve."""
    option: str
    """Command, or option of `midair play`."""

    @property
    def row(self) -> tuple[str, str, str]:
        """Name, people and option as text."""
        return self.name, "see --plan" if self.felt is None else f"{self.felt.people[0]} of 10", self.option


def ways_to_play(
    felt: Felt, excess: float, *, source: object = "RECORDING", quiet: Felt | None = None
) -> Sequence[Way]:
    """List what a person may do about a drive that is `excess` dB too loud; nothing is chosen or assumed.

    Radiation pressure goes with the square of sound. `source` names the recording in commands, empty if there is none;
    `quiet` is the touch of the mode quiet, if it was solved.
    """
    weaker, protected = felt.at(-2 * excess), felt.at(-2 * max(excess - PROTECTION, 0))
    protect = f"--ear-protection {PROTECTION:g}dB" + " --attenuate" * (excess > PROTECTION)
    solve = (
        [Way(name="solve for quiet ears", felt=quiet, option=f"midair solve {source} --mode quiet")] if source else []
    )
    return (
        Way(name="protect all ears in the room", felt=protected, option=protect),
        *solve,
        Way(name="play it weaker", felt=weaker, option="--attenuate"),
        Way(name="answer for it by name", felt=felt, option="--override-exposure NAME"),
    )
