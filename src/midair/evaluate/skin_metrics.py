"""Perceptual metrics of a reproduction: several numbers with an explanation each, for each cell and overall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import resample
from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.comparison import check_alike
from midair.evaluate.perception import RATE, SkinModel, pacinian_level, similarities
from midair.model import PressureFrames
from midair.streaming import LazyFrames, as_lazy, blocks, each_frame

Array = NDArray[np.float64]


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
                {
                    "name": each.name,
                    "unit": each.unit,
                    "overall": each.overall,
                    "channels": each.channels.tolist(),
                    "meaning": each.meaning,
                }
                for each in self.figures
            ],
        }

    def verdict(self) -> str:
        """Predict in one sentence whether a palm would feel the reproduction and how similar it would be.

        Felt means 0 dB over the threshold or more; equally strong means within one just noticeable difference (Forta,
        Griffin and Morioka 2012); the same spectrum means an SPQI of .5 or more, a difference of a fifth of the power.
        """
        return f"A palm would {self.felt()}, {self.reservation()}."

    def felt(self) -> str:
        """Prediction in a few words, without the reservation."""
        felt, steps = (
            self.figure(name).overall
            for name in ("Pacinian power, reproduced", "the same in just noticeable differences")
        )
        if felt < 0:
            return "not feel it"
        strong = "as strong as" if abs(steps) <= 1 else f"{'stronger' if steps > 0 else 'weaker'} than"
        alike = "much the same" if self.figure("SPQI").overall >= 0.5 else "another"
        return f"feel it, {strong} the original and with {alike} spectrum"

    def reservation(self) -> str:
        """Statement that the prediction comes from a model."""
        return f"by a model of skin ({'simulated, ' if self.simulated else ''}not tried on people)"

    def __repr__(self) -> str:
        cells = f"{int(self.compared.sum())} of {self.compared.size} cells"
        return f"<PerceptualMetrics {len(self.figures)} figures on {cells}{', SIMULATED' if self.simulated else ''}>"


def perceptual_metrics(
    original: PressureFrames, reproduced: PressureFrames, *, skin: SkinModel | None = None, weakest: float = 20.0
) -> PerceptualMetrics:
    """Compute the perceptual metrics of a reproduction.

    A delay common to all cells is removed first; the level is not fitted. ST-SIM and SPQI are computed at 8 kHz after
    resampling; their overall values are means over the compared cells, weighted by the original's power. Powers are
    summed over the cells.

    Parameters
    ----------
    original, reproduced : PressureFrames
        Pressures of the same cells at the same rate, at least 64 ms long. Lazy frames are read block by block.
    weakest : float
        Cells are compared down to this many dB below the strongest cell.

    Raises
    ------
    MismatchError, RateError
        If the cells or the rates differ.
    ShapeError
        If they are too short.
    """
    check_alike(original, reproduced)
    skin, rate = skin or SkinModel(), original.rate
    frames = min(original.frames, reproduced.frames)
    x, y = original.pressure[:frames], reproduced.pressure[:frames]
    delay = find_delay(x, y, rate, longest=min(0.05, (frames - 1) / rate))
    y = advance(y, delay, rate)
    power = np.zeros(original.sensor.shape)
    for block in blocks(x):
        power += (block**2).sum(axis=0) / frames
    before, after = pacinian_level(x, rate, skin), pacinian_level(y, rate, skin)
    compared = (power > 0) & (power >= power.max() * 10 ** (-weakest / 10))
    apart = _difference(_total(after), _total(before))
    apart_by_cell = np.where(compared, _difference(after, before), np.nan)
    return PerceptualMetrics(
        figures=(
            *_similarities(x, y, rate, skin, np.where(compared, power, 0.0)),
            PerceptualFigure(
                name="Pacinian power, original",
                unit="dB",
                overall=float(_total(before)),
                channels=before,
                meaning="Vibration of the original in dB over the detection threshold of a palm, weighted by the "
                "sensitivity of Pacinian corpuscles; nothing is felt below 0.",
            ),
            PerceptualFigure(
                name="Pacinian power, reproduced",
                unit="dB",
                overall=float(_total(after)),
                channels=after,
                meaning="The same for the reproduction; nothing is felt below 0.",
            ),
            PerceptualFigure(
                name="Pacinian power difference",
                unit="dB",
                overall=float(apart),
                channels=apart_by_cell,
                meaning="Reproduced minus original: above 0 the reproduction feels rougher and stronger than the "
                "original, below 0 smoother and weaker.",
            ),
            PerceptualFigure(
                name="the same in just noticeable differences",
                unit="JND",
                overall=float(apart / skin.step),
                channels=apart_by_cell / skin.step,
                meaning=f"In steps of {skin.step:g} dB, the smallest difference of strength that people notice on the "
                "palm at 125 Hz: between -1 and 1 most people would not notice a difference of strength.",
            ),
            PerceptualFigure(
                name="stray power",
                unit="dB",
                overall=float(_difference(_total(np.where(compared, -np.inf, after)), _total(before))),
                channels=np.where(compared, np.nan, _difference(after, _total(before))),
                meaning="Pacinian power on cells where the original hardly presses, relative to the original's total: "
                "lower values mean less vibration at wrong places.",
            ),
        ),
        compared=compared,
        simulated=original.provenance.simulated or reproduced.provenance.simulated,
    )


def _similarities(
    x: Array | LazyFrames, y: Array | LazyFrames, rate: float, skin: SkinModel, weight: Array
) -> tuple[PerceptualFigure, PerceptualFigure]:
    """ST-SIM and SPQI of the cells with a weight."""
    scale = skin.metric_scale()
    pair = [each_frame(resample(as_lazy(each), rate, RATE), lambda block: scale * block) for each in (x, y)]
    maps = similarities(*pair, compared=weight.ravel() > 0).reshape(2, *weight.shape)
    means = np.nansum(maps * weight, axis=(1, 2)) / (weight.sum() or 1.0)
    return (
        PerceptualFigure(
            name="ST-SIM",
            unit="",
            overall=float(means[0]),
            channels=maps[0],
            meaning="1 if waveform and felt spectrum are equal in each 64 ms, 0 without any similarity; a changed "
            "waveform lowers it even if skin might not notice, and a stronger felt vibration than the original's can "
            "raise it above 1.",
        ),
        PerceptualFigure(
            name="SPQI",
            unit="",
            overall=float(means[1]),
            channels=maps[1],
            meaning="1 if the felt spectra are equal, for any waveform; .5 if the difference has a fifth of the "
            "original's power, .02 if it has as much power as the original.",
        ),
    )


def _total(levels: Array) -> Array:
    """Level of the summed power in dB; minus infinity for silence."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10((10 ** (levels / 10)).sum()), np.float64)


def _difference(after: Array, before: Array) -> Array:
    """`after` minus `before`; 0 where both are silent."""
    # Minus infinity minus minus infinity would be NaN.
    silent = np.isneginf(after) & np.isneginf(before)
    return np.where(silent, 0.0, np.where(silent, 0.0, after) - np.where(silent, 0.0, before))
