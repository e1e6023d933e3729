"""Perceptual metrics of a reproduction: several numbers with an explanation each, for each cell and overall."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.dsp import resample
from midair.errors import ShapeError
from midair.evaluate.comparison import check_alike
from midair.evaluate.distortion import WEAKEST, advance, find_delay
from midair.evaluate.perception import (
    FELT_BANDS,
    RATE,
    SkinModel,
    band_levels,
    pacinian_level,
    similarities,
)
from midair.evaluate.spectra import level
from midair.model import PressureFrames


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PerceptualFigure:
    """One perceptual metric."""

    name: str
    unit: str
    """Empty for a ratio."""
    overall: float
    """Value over all cells."""
    channels: Array
    """Value for each cell, shape (row, column); NaN where the original is too weak."""
    meaning: str
    """Explanation in one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PerceptualMetrics:
    """Perceptual metrics of a reproduction from published models of skin; there is no total score."""

    figures: tuple[PerceptualFigure, ...]
    compared: NDArray[np.bool_]
    """Mask of the cells whose original is strong enough, shape (row, column)."""
    simulated: bool
    """Whether any part was simulated."""

    def figure(self, name: str) -> PerceptualFigure:
        """Return the figure with this name."""
        return next(each for each in self.figures if each.name == name)

    def plain(self) -> dict[str, object]:
        """Values for JSON; cells that are not compared are null."""
        return {
            "simulated": self.simulated,
            "verdict": self.verdict(),
            "figures": [
                {name: getattr(each, name) for name in ("name", "unit", "overall", "meaning")}
                | {"channels": each.channels.tolist()}
                for each in self.figures
            ],
        }

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Name, value, unit and meaning of each metric, without repeated meanings; both signals in one row."""
        rows, said = list[tuple[str, str, str, str]](), ""
        for each in self.figures:
            name, value = each.name.removesuffix(_BEFORE), f"{each.overall:.3g}"
            if name != each.name:
                value += f" → {self.figure(name + _AFTER).overall:.3g}"
            if not each.name.endswith(_AFTER):
                rows.append((name, value, each.unit, "" if each.meaning == said else each.meaning))
                said = each.meaning
        return rows

    def verdict(self) -> str:
        """Predict in one sentence whether a palm would feel the reproduction and how similar it would be.

        Felt means that the strongest cell is over the detection threshold in some band; equally strong means within one
        just noticeable difference (Forta, Griffin and Morioka 2012); the same spectrum means an SPQI of .5 or more
        after the level is matched, a difference of a fifth of the power.
        """
        return f"A palm would {self.felt()}: {self.bands()}; {self.reservation()}."

    def felt(self) -> str:
        """Prediction in a few words, without the bands and the reservation."""
        steps = self.figure("the same in just noticeable differences").overall
        if max(self._levels()) < 0:
            return "not feel it"
        times = 10 ** (self.figure("Pacinian power difference").overall / 20)
        strong = "as strong as" if abs(steps) <= 1 else f"{times:.2g} times as strong as"
        if abs(steps) > 1 and 0.5 <= times <= 2:
            strong = f"{abs(100 * (times - 1)):.0f} % {'stronger' if times > 1 else 'weaker'} than"
        alike = "much the same" if self.figure("SPQI, level matched").overall >= 0.5 else "another"
        return f"feel it, {strong} the original and with {alike} spectrum"

    def bands(self) -> str:
        """Level of the reproduction over the detection threshold in each band, and how people differ."""
        levels = [
            f"{low:g} to {high:g} Hz {abs(level):.0f} dB {'above' if level >= 0 else 'below'}"
            if level > -40
            else f"{low:g} to {high:g} Hz far below"
            for (low, high), level in zip(FELT_BANDS, self._levels(), strict=True)
        ]
        lower, upper = SkinModel().people
        return (
            f"{', '.join(levels)} the detection threshold, that of people lies {lower:+.0f} to {upper:+.0f} dB from it"
        )

    def _levels(self) -> list[float]:
        return [self.figure(_band_name(band) + _AFTER).overall for band in FELT_BANDS]

    def reservation(self) -> str:
        """Statement that the prediction comes from a model."""
        return f"by a model of skin ({'simulated, ' if self.simulated else ''}not tried on people)"

    def __repr__(self) -> str:
        cells = f"{int(self.compared.sum())} of {self.compared.size} cells"
        return f"<PerceptualMetrics {len(self.figures)} figures on {cells}{', SIMULATED' if self.simulated else ''}>"


def perceptual_metrics(original: PressureFrames, reproduced: PressureFrames) -> PerceptualMetrics:
    """Compute the perceptual metrics of a reproduction.

    A delay common to all cells is removed first; the level is not fitted. ST-SIM and SPQI are computed at 8 kHz after
    resampling; their overall values are means over the compared cells, weighted by the original's power. Powers are
    summed over the cells.

    Both are pressures of the same cells at the same rate, at least 64 ms long. Cells are compared down to 20 dB below
    the strongest cell.

    Raises MismatchError or RateError if the cells or the rates differ, ShapeError if they are too short.
    """
    check_alike(original, reproduced)
    skin, rate = SkinModel(), original.rate
    frames = min(original.frames, reproduced.frames)
    x, y = original.pressure[:frames], reproduced.pressure[:frames]
    delay = find_delay(x, y, rate)
    # A delay of rounding errors would fill silent blocks with noise.
    y = advance(y, delay, rate) if abs(delay) > 1e-9 else y
    power = (x**2).sum(axis=0) / frames
    before, after = pacinian_level(x, rate), pacinian_level(y, rate)
    compared = (power > 0) & (power >= power.max() * 10 ** (-WEAKEST / 10))
    apart = _difference(_total(after), _total(before))
    # The level is that of the felt vibration, so that it does not depend on the waveform.
    level = float(10 ** (apart / 20)) if np.isfinite(apart) else 1.0
    apart_by_cell = np.where(compared, _difference(after, before), np.nan)
    stray = np.where(compared, np.nan, _difference(after, _total(before)))
    return PerceptualMetrics(
        figures=(
            *_similarities(x, y, rate, skin, np.where(compared, power, 0.0), level),
            *_both(
                "Pacinian power",
                "dB",
                [(_total(each), each) for each in (before, after)],
                "Vibration in dB over the detection threshold of a palm, weighted by the sensitivity of Pacinian "
                "corpuscles and summed over the cells.",
            ),
            _metric(
                ("Pacinian power difference", "dB"),
                (apart, apart_by_cell),
                "Reproduced minus original: above 0 the reproduction feels rougher and stronger than the original, "
                "below 0 smoother and weaker.",
            ),
            _metric(
                ("the same in just noticeable differences", "JND"),
                (apart / skin.step, apart_by_cell / skin.step),
                f"In steps of {skin.step:g} dB, the smallest difference of strength that people notice on the palm at "
                "125 Hz: between -1 and 1 most people would not notice a difference of strength.",
            ),
            _metric(
                ("stray power", "dB"),
                (_difference(_total(np.where(compared, -np.inf, after)), _total(before)), stray),
                "Pacinian power on cells where the original hardly presses, relative to the original's total: lower "
                "values mean less vibration at wrong places.",
            ),
            *_over_threshold(x, y, rate, skin, float(compared.sum()) * original.sensor.pitch**2),
        ),
        compared=compared,
        simulated=original.provenance.simulated or reproduced.provenance.simulated,
    )


def metrics_or_none(original: PressureFrames, reproduced: PressureFrames) -> PerceptualMetrics | None:
    """Perceptual metrics; None for less than 64 ms, the shortest signal they need."""
    try:
        return perceptual_metrics(original, reproduced)
    except ShapeError:
        return None


_BEFORE, _AFTER = ", original", ", reproduced"
"""Ends of the names of two figures that are one row."""

Values = tuple[Array | float, Array]
"""Overall value, and that of each cell, shape (row, column)."""


def _metric(name: tuple[str, str], values: Values, meaning: str) -> PerceptualFigure:
    return PerceptualFigure(name=name[0], unit=name[1], overall=float(values[0]), channels=values[1], meaning=meaning)


def _both(name: str, unit: str, pair: Sequence[Values], meaning: str) -> list[PerceptualFigure]:
    return [_metric((name + end, unit), each, meaning) for end, each in zip((_BEFORE, _AFTER), pair, strict=True)]


def _band_name(band: tuple[float, float]) -> str:
    return f"{band[0]:g} to {band[1]:g} Hz over the threshold"


def _over_threshold(x: Array, y: Array, rate: float, skin: SkinModel, area: float) -> list[PerceptualFigure]:
    """Level of each band over the detection threshold for a contact area in m2."""
    pair = [band_levels(each, rate, area=area) for each in (x, y)]
    meaning = (
        "Vibration of the strongest cell in dB over the nominal detection threshold of a palm for the touched area; "
        f"the thresholds of people lie {skin.people[0]:+g} to {skin.people[1]:+g} dB from it."
    )
    return [
        each
        for band, maps in zip(FELT_BANDS, zip(*pair, strict=True), strict=True)
        for each in _both(_band_name(band), "dB", [(levels.max(), levels) for levels in maps], meaning)
    ]


def _similarities(
    x: Array, y: Array, rate: float, skin: SkinModel, weight: Array, level: float
) -> list[PerceptualFigure]:
    """ST-SIM and SPQI of the cells with a weight, after `level` is divided out, and with it."""
    scale, found = skin.metric_scale(), list[PerceptualFigure]()
    meanings = (
        (
            "1 if waveform and felt spectrum are equal in each 64 ms, after the felt levels are matched.",
            "The same with the level: 0 without any similarity; a changed waveform lowers it even if skin might not "
            "notice, and a stronger felt vibration than the original's can raise it above 1.",
        ),
        (
            "1 if the felt spectra are equal, for any waveform, after the felt levels are matched.",
            "The same with the level: .5 if the difference has a fifth of the original's power, .02 if it has as much "
            "power as the original.",
        ),
    )
    for which, (end, factor) in enumerate(((", level matched", level or 1.0), ("", 1.0))):
        pair = [by * resample(each, rate, RATE) for each, by in ((x, scale), (y, scale / factor))]
        maps = similarities(*pair, compared=weight.ravel() > 0).reshape(2, *weight.shape)
        means = np.nansum(maps * weight, axis=(1, 2)) / (weight.sum() or 1.0)
        for name, each, mean, meaning in zip(("ST-SIM", "SPQI"), maps, means, meanings, strict=True):
            found.append(_metric((name + end, ""), (mean, each), meaning[which]))
    return found


def _total(levels: Array) -> Array:
    """Level of the summed power in dB; minus infinity for silence."""
    return level((10 ** (levels / 10)).sum())


def _difference(after: Array, before: Array) -> Array:
    """`after` minus `before`; 0 where both are silent."""
    # Minus infinity minus minus infinity would be NaN.
    silent = np.isneginf(after) & np.isneginf(before)
    return np.where(silent, 0.0, np.where(silent, 0.0, after) - np.where(silent, 0.0, before))
