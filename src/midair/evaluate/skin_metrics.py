"""A card of how a reproduction is felt: several numbers, each with what it means, cell by cell and overall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.dsp import resample
from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.comparison import check_alike
from midair.evaluate.perception import RATE, SkinModel, pacinian_level, similarities
from midair.lazy_frames import LazyFrames, as_lazy, blocks, each_frame
from midair.model import PressureFrames

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PerceptualFigure:
    """One number of the card.

    Attributes
    ----------
    name : str
        What it is called.
    unit : str
        Unit of the value; empty for a ratio.
    overall : float
        Over all cells.
    channels : ndarray, shape (row, column)
        Cell by cell; NaN where the original is too weak to compare with.
    meaning : str
        One sentence.
    """

    name: str
    unit: str
    overall: float
    channels: Array
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PerceptualMetrics:
    """What skin would make of a reproduction, as far as published models of skin can say; there is no total.

    Attributes
    ----------
    figures : tuple of CardFigure
        The numbers.
    compared : ndarray of bool, shape (row, column)
        Cells whose original is strong enough to compare with.
    simulated : bool
        Whether any part of it was simulated.
    """

    figures: tuple[PerceptualFigure, ...]
    compared: NDArray[np.bool_]
    simulated: bool

    def figure(self, name: str) -> PerceptualFigure:
        """The figure of this name."""
        return next(each for each in self.figures if each.name == name)

    def plain(self) -> dict[str, object]:
        """Plain values for JSON; cells that are not compared are null."""
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
        """One sentence: whether a palm would feel it by this model, and whether it would be like the original.

        Felt from 0 dB over the threshold on; as strong within one just noticeable difference (Forta, Griffin and
        Morioka 2012); of the same felt spectrum where SPQI is .5 or more, a difference of a fifth of the power. A model
        says so, not people.
        """
        return f"A palm would {self.felt()}, {self.reservation()}."

    def felt(self) -> str:
        """The same in a few words, without the reservation: what a palm would."""
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
        """Who says so."""
        return f"by a model of skin ({'simulated, ' if self.simulated else ''}not tried on people)"

    def __repr__(self) -> str:
        cells = f"{int(self.compared.sum())} of {self.compared.size} cells"
        return f"<PerceptualCard {len(self.figures)} figures on {cells}{', SIMULATED' if self.simulated else ''}>"


def perceptual_metrics(
    original: PressureFrames, reproduced: PressureFrames, *, skin: SkinModel | None = None, weakest: float = 20.0
) -> PerceptualMetrics:
    """Fill in the card of a reproduction.

    A delay common to all cells is taken out first; the level is not refitted. ST-SIM and SPQI are for 8 kHz, to which
    both are resampled; their overall values are means over the compared cells, weighted by the original's power.
    Powers are summed over the cells.

    Parameters
    ----------
    original, reproduced : PressureFrames
        Pressures of the same cells at the same rate, at least 64 ms of them. Of reels a block is in memory
        at a time.
    skin : SkinModel, optional
        The defaults of `SkinModel` if None.
    weakest : float
        By how many dB a cell may be below the strongest one to be compared.

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
                meaning="The original's vibration in dB over what is just felt on a palm, weighted as Pacinian "
                "corpuscles feel it; below 0 nothing is felt.",
            ),
            PerceptualFigure(
                name="Pacinian power, reproduced",
                unit="dB",
                overall=float(_total(after)),
                channels=after,
                meaning="The same of the reproduction; below 0 nothing is felt.",
            ),
            PerceptualFigure(
                name="Pacinian power difference",
                unit="dB",
                overall=float(apart),
                channels=apart_by_cell,
                meaning="Reproduced less original: above 0 it feels rougher and stronger than the original, below 0 "
                "smoother and weaker.",
            ),
            PerceptualFigure(
                name="the same in just noticeable differences",
                unit="JND",
                overall=float(apart / skin.step),
                channels=apart_by_cell / skin.step,
                meaning=f"In steps of {skin.step:g} dB, the least difference of strength that people tell on the palm "
                "at 125 Hz: between -1 and 1 most would not tell the two apart by their strength.",
            ),
            PerceptualFigure(
                name="stray power",
                unit="dB",
                overall=float(_difference(_total(np.where(compared, -np.inf, after)), _total(before))),
                channels=np.where(compared, np.nan, _difference(after, _total(before))),
                meaning="Pacinian power on cells where the original hardly presses, over all of the original's: the "
                "lower, the less is felt where nothing was.",
            ),
        ),
        compared=compared,
        simulated=original.provenance.simulated or reproduced.provenance.simulated,
    )


def _similarities(
    x: Array | LazyFrames, y: Array | LazyFrames, rate: float, skin: SkinModel, weight: Array
) -> tuple[PerceptualFigure, PerceptualFigure]:
    """ST-SIM and SPQI of the cells that have a weight."""
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
            meaning="1 when waveform and felt spectrum are the same in each 64 ms, 0 when nothing is alike; a changed "
            "waveform lowers it even where skin might not notice, and more that is felt than in the original lifts it "
            "above 1.",
        ),
        PerceptualFigure(
            name="SPQI",
            unit="",
            overall=float(means[1]),
            channels=maps[1],
            meaning="1 when the felt spectrum is the same, whatever the waveform; .5 when the difference has a fifth "
            "of the original's power, .02 when it has all of it.",
        ),
    )


def _total(levels: Array) -> Array:
    """Level of the summed power, in dB; minus infinity by silence."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10((10 ** (levels / 10)).sum()), np.float64)


def _difference(after: Array, before: Array) -> Array:
    """After less before; 0 where both are silent."""
    # Minus infinity less minus infinity would be NaN.
    silent = np.isneginf(after) & np.isneginf(before)
    return np.where(silent, 0.0, np.where(silent, 0.0, after) - np.where(silent, 0.0, before))
