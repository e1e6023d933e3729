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
from midair.evaluate.felt import Felt, felt
from midair.evaluate.perception import METRIC_SCALE, RATE, similarities
from midair.evaluate.spectra import level
from midair.model import PressureFrames
from midair.physics import TOUCH_CHANNELS

STEP = 1.58
"""Just noticeable difference of a level in dB: a Weber fraction of .20 of the amplitude, the median at 125 Hz on the
thenar eminence (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012)."""


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
    felt: Felt
    """Level of the reproduction over the detection threshold."""
    simulated: bool
    """Whether any part was simulated."""

    def figure(self, name: str) -> PerceptualFigure:
        """Return the figure with this name."""
        return next(each for each in self.figures if each.name == name)

    def plain(self) -> dict[str, object]:
        """Values for JSON; cells that are not compared are null."""
        return {
            "simulated": self.simulated,
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
    rate = original.rate
    frames = min(original.frames, reproduced.frames)
    x, y = original.pressure[:frames], reproduced.pressure[:frames]
    delay = find_delay(x, y, rate)
    # A delay of rounding errors would fill silent blocks with noise.
    y = advance(y, delay, rate) if abs(delay) > 1e-9 else y
    power = (x**2).sum(axis=0) / frames
    before, after = _pacinian_level(x, rate), _pacinian_level(y, rate)
    over = [felt(each, rate, original.sensor.pitch) for each in (x, y)]
    compared = (power > 0) & (power >= power.max() * 10 ** (-WEAKEST / 10))
    apart = _difference(_total(after), _total(before))
    # The level is that of the felt vibration, so that it does not depend on the waveform.
    level = float(10 ** (apart / 20)) if np.isfinite(apart) else 1.0
    apart_by_cell = np.where(compared, _difference(after, before), np.nan)
    stray = np.where(compared, np.nan, _difference(after, _total(before)))
    return PerceptualMetrics(
        figures=(
            *_similarities(x, y, rate, np.where(compared, power, 0.0), level),
            *_both(
                "level over the threshold",
                "dB",
                [(each.level, np.full(power.shape, np.nan)) for each in over],
                "Vibration in dB over the detection threshold of half of all people where and when it is strongest: "
                f"mean of {len(over[0].levels)} models of skin.",
            ),
            _metric(
                ("Pacinian power difference", "dB"),
                (apart, apart_by_cell),
                "Reproduced minus original: above 0 the reproduction feels rougher and stronger than the original, "
                "below 0 smoother and weaker.",
            ),
            _metric(
                ("the same in just noticeable differences", "JND"),
                (apart / STEP, apart_by_cell / STEP),
                f"In steps of {STEP:g} dB, the smallest difference of strength that people notice on the palm at "
                "125 Hz: between -1 and 1 most people would not notice a difference of strength.",
            ),
            _metric(
                ("stray power", "dB"),
                (_difference(_total(np.where(compared, -np.inf, after)), _total(before)), stray),
                "Pacinian power on cells where the original hardly presses, relative to the original's total: lower "
                "values mean less vibration at wrong places.",
            ),
        ),
        compared=compared,
        felt=over[1],
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


def _pacinian_level(pressure: Array, rate: float) -> Array:
    """Level of each channel's pressure with the weights of the Pacinian channel, in dB, shape (row, column).

    On displacement it predicts the perceived roughness of textures (Bensmaia and Hollins, Percept. Psychophys. 65(6),
    2003); differences of levels hardly depend on the skin.
    """
    spectrum = np.fft.rfft(pressure, axis=0) * 2 / len(pressure)
    weight = TOUCH_CHANNELS["P"].weight(np.asarray(np.fft.rfftfreq(len(pressure), 1 / rate), np.float64))
    return level((np.abs(spectrum * weight[:, None, None]) ** 2).sum(axis=0))


def _similarities(x: Array, y: Array, rate: float, weight: Array, level: float) -> list[PerceptualFigure]:
    """ST-SIM and SPQI of the cells with a weight, after `level` is divided out, and with it."""
    found = list[PerceptualFigure]()
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
        pair = [by * resample(each, rate, RATE) for each, by in ((x, METRIC_SCALE), (y, METRIC_SCALE / factor))]
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
