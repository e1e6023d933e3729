"""What a whole palm gets: pressure where none was asked for, and how its skin moves.

A sensor's cells hear what presses on them. Skin also moves with what presses beside them and between them, and its
waves carry that on. The measures here are of the same kind as those of the cells, signal over distortion in the band,
over every point of a palm: once of the pressure, and once of the displacement of each of several skins, since nobody
knows which one a palm is. What is wanted is the recorded pressure, interpolated between the cells, and none beyond.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from midair.dsp import resample
from midair.evaluate.alignment import advance, find_delay
from midair.evaluate.distortion import Band, decibels, in_band
from midair.model import Palm
from midair.physics import SKINS, SkinMotion, Tissue
from midair.validation import frozen_array

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressedPalm:
    """How hard it pressed on each point of a palm.

    Attributes
    ----------
    wanted, delivered : ndarray, shape (row, column)
        Root mean square of the pressure in the band, in Pa; NaN where there is no skin.
    pitch : float
        Between the points, in m.
    square : tuple of float
        Half the sides of the square that the sensor covers, along x and y, in m.
    """

    wanted: Array
    delivered: Array
    pitch: float
    square: tuple[float, float]

    def __post_init__(self) -> None:
        for name in ("wanted", "delivered"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ("row", "column"), finite=False))


@dataclass(frozen=True, slots=True, kw_only=True)
class PalmFidelity:
    """What came through to a palm.

    Attributes
    ----------
    outside : float
        Part of the power of the pressure in the band that lies on the palm outside the square of the sensor, 0 to 1.
    pressure : float
        Signal over distortion of the pressure over the palm, in dB, one gain and delay fitted.
    square : float
        The same within the square of the sensor.
    displacement : Mapping of str to float
        The same of the displacement over the palm, for each skin by its name.
    palm : str
        Name of the palm.
    pressed : PressedPalm or None
        Where on it; None where only the figures are known.
    """

    outside: float
    pressure: float
    square: float
    displacement: Mapping[str, float]
    palm: str
    pressed: PressedPalm | None = field(default=None, repr=False, compare=False)

    @property
    def range(self) -> tuple[float, float]:
        """Least and greatest of the displacement's, in dB."""
        return min(self.displacement.values()), max(self.displacement.values())

    def plain(self) -> dict[str, object]:
        """Plain values for JSON; what is infinite is null."""
        return {
            "palm": self.palm,
            "outside": self.outside,
            "sdr_pressure_db": _finite(self.pressure),
            "sdr_pressure_in_square_db": _finite(self.square),
            "sdr_displacement_db": {name: _finite(each) for name, each in self.displacement.items()},
        }

    def figures(self) -> dict[str, tuple[float, str]]:
        """Every figure with its unit, by the words that people read."""
        low, high = self.range
        return {
            "palm: power outside the square": (100 * self.outside, "%"),
            "palm: pressure, signal to distortion": (self.pressure, "dB"),
            "palm: the same in the square": (self.square, "dB"),
            "palm: displacement, worst skin": (low, "dB"),
            "palm: displacement, best skin": (high, "dB"),
        }

    def __repr__(self) -> str:
        low, high = self.range
        said = f"{100 * self.outside:.0f} % outside, pressure {self.pressure:.1f} dB"
        return f"<PalmFidelity {said}, displacement {low:.1f} to {high:.1f} dB, SIMULATED>"


def palm_fidelity(
    wanted: Array,
    delivered: Array,
    palm: Palm,
    *,
    rates: tuple[float, float],
    square: tuple[float, float],
    judged: tuple[float, float] | None = None,
    band: Band = (20.0, 470.0),
    skins: Mapping[str, Tissue] = SKINS,
) -> PalmFidelity:
    """Compare what pressed on a palm with what was to press.

    Parameters
    ----------
    wanted, delivered : ndarray, shape (frame, point)
        Pressure at the points of the palm that are skin, row by row, in Pa.
    palm : Palm
        Where skin is.
    rates : tuple of float
        Of the two, in Hz.
    square : tuple of float
        Half the sides of the square that the sensor covers, along x and y, in m.
    judged : tuple of float, optional
        (begin, duration) of the part that is judged, in s; what presses before it moves the skin all the same. All if
        None.
    band : tuple of float
        (low, high) that counts, in Hz; cut sharply.
    skins : Mapping of str to Tissue
        What is to move.
    """
    x, y, slow = _together(wanted, delivered, rates, band)
    frames = len(x)
    begin, duration = judged or (0.0, frames / slow)
    part = slice(round(begin * slow), round((begin + duration) * slow))
    beyond = palm.beyond(*square)[palm.inside]
    power = (y[part] ** 2).sum(axis=0)
    moved = {
        name: _ratio(*(_moved(tissue, each, palm, slow, band)[part] for each in (x, y)))
        for name, tissue in skins.items()
    }
    return PalmFidelity(
        outside=float(power[beyond].sum() / max(float(power.sum()), np.finfo(float).tiny)),
        pressure=_ratio(x[part], y[part]),
        square=_ratio(x[part][:, ~beyond], y[part][:, ~beyond]),
        displacement=MappingProxyType(moved),
        palm=palm.name,
        pressed=PressedPalm(
            wanted=_mapped(x[part], palm), delivered=_mapped(y[part], palm), pitch=palm.pitch, square=square
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmFrames:
    """What pressed on a palm moment by moment, and how its skin moved.

    Attributes
    ----------
    wanted, delivered : ndarray, shape (frame, row, column)
        Pressure in the band, in Pa; NaN where there is no skin. What is wanted is as loud as what came, and comes
        when that came.
    wanted_motion, motion : ndarray, shape (frame, row, column)
        How far the skin is pressed in, in m.
    rate : float
        In Hz.
    pitch : float
        Between the points, in m.
    square : tuple of float
        Half the sides of the square that the sensor covers, along x and y, in m.
    skin : str
        Name of the model skin.
    """

    wanted: Array
    delivered: Array
    wanted_motion: Array
    motion: Array
    rate: float
    pitch: float
    square: tuple[float, float]
    skin: str


def palm_frames(
    wanted: Array,
    delivered: Array,
    palm: Palm,
    *,
    rates: tuple[float, float],
    square: tuple[float, float],
    judged: tuple[float, float] | None = None,
    band: Band = (20.0, 470.0),
    skin: str = "soft, deep",
) -> PalmFrames:
    """What `palm_fidelity` compares, as frames of about 1 kHz to be looked at.

    Parameters
    ----------
    wanted, delivered, palm, rates, square, judged, band
        As in `palm_fidelity`.
    skin : str
        Name of one of `physics.SKINS`.
    """
    x, y, rate = _together(wanted, delivered, rates, band)
    # As loud as what came of it.
    x = x * (float((x * y).sum()) / max(float((x**2).sum()), np.finfo(float).tiny))
    begin, duration = judged or (0.0, len(x) / rate)
    every = max(1, round(rate / max(1000.0, 2.2 * band[1])))
    part = slice(round(begin * rate), round((begin + duration) * rate), every)
    moved = (_moved(SKINS[skin], each, palm, rate, band) for each in (x, y))
    x, y, wanted_motion, motion = (_spread(each[part], palm) for each in (x, y, *moved))
    return PalmFrames(
        wanted=x,
        delivered=y,
        wanted_motion=wanted_motion,
        motion=motion,
        rate=rate / every,
        pitch=palm.pitch,
        square=square,
        skin=skin,
    )


def _together(wanted: Array, delivered: Array, rates: tuple[float, float], band: Band) -> tuple[Array, Array, float]:
    """Both in the band and at one rate, the second without its delay; and that rate."""
    slow = _rate_for(band)
    x, y = (
        in_band(resample(each, rate, slow), slow, band) for each, rate in zip((wanted, delivered), rates, strict=True)
    )
    frames = min(len(x), len(y))
    x, y = x[:frames], y[:frames]
    y = advance(y, find_delay(x, y, slow, longest=min(0.05, (frames - 1) / slow)), slow)
    return x, y, slow


def _spread(values: Array, palm: Palm) -> Array:
    """Values of the skin on the palm's grid, NaN beside it."""
    on_grid = np.full((len(values), *palm.inside.shape), np.nan)
    on_grid[:, palm.inside] = values
    return on_grid


def _mapped(pressure: Array, palm: Palm) -> Array:
    """Root mean square at each point of the palm's grid, NaN beside the skin."""
    on_grid = np.full(palm.inside.shape, np.nan)
    on_grid[palm.inside] = np.sqrt((pressure**2).mean(axis=0))
    return on_grid


def _rate_for(band: Band) -> float:
    """A rate at which the peak of a correlation tells the delay: eight times the band's end, 4 kHz for the paper's."""
    return float(1000 * np.ceil(8 * band[1] / 1000))


def _moved(tissue: Tissue, pressure: Array, palm: Palm, rate: float, band: Band) -> Array:
    """Displacement of the palm's skin, shape (frame, point)."""
    load = np.zeros((len(pressure), *palm.inside.shape))
    load[:, palm.inside] = pressure
    motion = _motion(tissue, palm.inside.shape, palm.pitch, rate, band)
    return motion.displacement(load)[:, palm.inside]


@cache
def _motion(tissue: Tissue, shape: tuple[int, int], pitch: float, rate: float, band: Band) -> SkinMotion:
    """The same for every pressure, and dearer than to use it."""
    return SkinMotion.of(tissue, shape, pitch=pitch, rate=rate, band=band, edge=band[0] / 2)


def _ratio(x: Array, y: Array) -> float:
    """Signal over distortion of y, of which x with one gain is the signal, in dB."""
    power = float((x**2).sum())
    gain = float((x * y).sum()) / max(power, np.finfo(float).tiny)
    return decibels(gain**2 * power, float(((y - gain * x) ** 2).sum()))


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
