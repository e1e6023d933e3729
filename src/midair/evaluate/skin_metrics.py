"""Perceptual metrics of a reproduction: several numbers with an explanation each, for each cell and overall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.dsp import resample
from midair.errors import ShapeError
from midair.evaluate.comparison import check_alike
from midair.evaluate.distortion import WEAKEST, advance, find_delay
from midair.evaluate.felt import Felt, felt
from midair.evaluate.perception import METRIC_SCALE, RATE, level, similarities
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

    A delay common to all cells is removed first. ST-SIM and SPQI are computed at 8 kHz after resampling, and after the
    levels of the Pacinian channel are matched; their overall values are means over the compared cells, weighted by the
    original's power.

    Both are pressures of the same cells at the same rate, at least 64 ms long. Cells are compared down to 20 dB below
    the strongest cell.

    Raises MismatchError or RateError if the cells or the rates differ, ShapeError if they are too short.
    """
    check_alike(original, reproduced)
    rate, frames = original.rate, min(original.frames, reproduced.frames)
    x, y = original.pressure[:frames], reproduced.pressure[:frames]
    delay = find_delay(x, y, rate)
    # A delay of rounding errors would fill silent blocks with noise.
    y = advance(y, delay, rate) if abs(delay) > 1e-9 else y
    power = (x**2).sum(axis=0) / frames
    before, after = _pacinian_power(x, rate), _pacinian_power(y, rate)
    compared = (power > 0) & (power >= power.max() * 10 ** (-WEAKEST / 10))
    apart = _difference(after.sum(), before.sum())
    factor = 10 ** (float(apart) / 20) if np.isfinite(apart) else 1.0
    pair = [by * resample(each, rate, RATE) for each, by in ((x, METRIC_SCALE), (y, METRIC_SCALE / factor))]
    st_sim, spqi = similarities(*pair, compared=compared.ravel()).reshape(2, *power.shape)
    felt_levels = [felt(each, rate, original.sensor.pitch) for each in (x, y)]
    weight = np.where(compared, power, 0.0) / (power[compared].sum() or 1.0)
    unknown = np.full(power.shape, np.nan)
    figures = (
        ("ST-SIM", "", np.nansum(st_sim * weight), st_sim,
         "1 same waveform and felt spectrum at equal levels, 0 no similarity"),
        ("SPQI", "", np.nansum(spqi * weight), spqi,
         "1 same felt spectrum at equal levels, 0.5 similar, 0.02 different"),
        ("other frequencies", "%", 100 * felt_levels[1].elsewhere(felt_levels[0]), unknown,
         "of what is felt, in other third octaves than the original's"),
        *(("level over the threshold" + end, "dB", each.level, unknown,
           f"strongest place and moment; mean of {len(each.levels)} models of skin")
          for end, each in zip((_BEFORE, _AFTER), felt_levels, strict=True)),
        ("Pacinian power difference", "dB", apart, np.where(compared, _difference(after, before), np.nan),
         f"above 0 it feels stronger and rougher than the original; most people do not notice {STEP:g} dB"),
    )  # fmt: skip
    return PerceptualMetrics(
        figures=tuple(
            PerceptualFigure(name=name, unit=unit, overall=float(overall), channels=channels, meaning=meaning)
            for name, unit, overall, channels, meaning in figures
        ),
        compared=compared,
        felt=felt_levels[1],
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


def _pacinian_power(pressure: Array, rate: float) -> Array:
    """Power of each channel's pressure with the weights of the Pacinian channel, in Pa2, shape (row, column).

    On displacement it predicts the perceived roughness of textures (Bensmaia and Hollins, Percept. Psychophys. 65(6),
    2003); differences of levels hardly depend on the skin.
    """
    spectrum = np.fft.rfft(pressure, axis=0) * 2 / len(pressure)
    weight = TOUCH_CHANNELS["P"].weight(np.asarray(np.fft.rfftfreq(len(pressure), 1 / rate), np.float64))
    return np.asarray((np.abs(spectrum * weight[:, None, None]) ** 2).sum(axis=0), np.float64)


def _difference(after: Array, before: Array) -> Array:
    """Level of `after` over `before` in dB; 0 where both are silent."""
    return np.where((after <= 0) & (before <= 0), 0.0, level(after, before))
