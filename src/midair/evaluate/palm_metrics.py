"""Fidelity over a whole palm: pressure outside the sensor's square, and displacement of the skin.

The cells of a sensor measure only the pressure on them. Skin also moves because of pressure beside and between the
cells, and waves in the skin spread this. These metrics are the signal-to-distortion ratios in the band over every point
of a palm, of the pressure and of the displacement of several skin models, because the properties of a palm vary. The
target is the recorded pressure, interpolated between the cells, and zero elsewhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from midair.array_types import Array
from midair.dsp import Band, resample
from midair.evaluate.distortion import advance, decibels, find_delay, finite, in_band
from midair.evaluate.felt import skin_motion
from midair.model import BAND, Palm
from midair.physics import SKINS, Tissue
from midair.validation import frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressedPalm:
    """Map of the pressure on a palm."""

    wanted: Array
    """Rms target pressure in the band in Pa, shape (row, column); NaN beside the skin."""
    delivered: Array
    """Rms delivered pressure in the band in Pa, shape (row, column); NaN beside the skin."""
    pitch: float
    """Distance of the points in m."""
    square: tuple[float, float]
    """Half the sides of the square that the sensor covers, along x and y, in m."""

    def __post_init__(self) -> None:
        for name in ("wanted", "delivered"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ("row", "column"), finite=False))


@dataclass(frozen=True, slots=True, kw_only=True)
class PalmFidelity:
    """Fidelity of a reproduction over a whole palm."""

    outside: float
    """Part of the pressure's power in the band outside the square of the sensor, 0 to 1."""
    pressure: float
    """Signal-to-distortion ratio of the pressure over the palm in dB, with one gain and without delay."""
    square: float
    """The same ratio within the square of the sensor."""
    displacement: Mapping[str, float]
    """The same ratio of the displacement over the palm, for each skin by its name."""
    palm: str
    """Name of the palm."""
    pressed: PressedPalm | None = field(default=None, repr=False, compare=False)
    """Map of the pressure; None if only the figures are known."""

    @property
    def range(self) -> tuple[float, float]:
        """Minimum and maximum of the displacement's ratios in dB."""
        return min(self.displacement.values()), max(self.displacement.values())

    def plain(self) -> dict[str, object]:
        """Values for JSON; infinite values are null."""
        return {
            "palm": self.palm,
            "outside": self.outside,
            "sdr_pressure_db": finite(self.pressure),
            "sdr_pressure_in_square_db": finite(self.square),
            "sdr_displacement_db": {name: finite(each) for name, each in self.displacement.items()},
        }

    def figures(self) -> dict[str, tuple[float, str]]:
        """Every figure with its unit, by its label in reports."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmFrames:
    """Pressure on a palm and displacement of its skin over time."""

    wanted: Array
    """Target pressure in Pa, scaled and aligned, shape (frame, row, column); NaN beside the skin."""
    delivered: Array
    """Delivered pressure in Pa, same shape."""
    wanted_motion: Array
    """Displacement into the skin for the target in m, same shape."""
    motion: Array
    """Displacement into the skin in m, same shape."""
    rate: float
    """In Hz."""
    pitch: float
    """Distance of the points in m."""
    square: tuple[float, float]
    """Half the sides of the square that the sensor covers, along x and y, in m."""
    skin: str
    """Name of the skin model."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PalmPressure:
    """Target and delivered pressure on the skin of a palm."""

    wanted: Array
    """Target in Pa, shape (frame, point), at the points of the palm that are skin, row by row."""
    delivered: Array
    """Pressure that was delivered in Pa, at the same points."""
    rates: tuple[float, float]
    """Frame rates in Hz of the two."""
    palm: Palm
    """Outline and points."""
    square: tuple[float, float]
    """Half the sides of the square that the sensor covers, along x and y, in m."""

    def fidelity(
        self,
        *,
        judged: tuple[float, float] | None = None,
        band: Band = BAND,
        skins: Mapping[str, Tissue] = SKINS,
    ) -> PalmFidelity:
        """Compare the delivered pressure with the target.

        `judged` is (begin, duration) of the evaluated part in s, all if None; earlier pressure still moves the skin.
        `band` (low, high) in Hz has sharp edges; `skins` are skin models by name.
        """
        x, y, part, rate = self._aligned(judged, band)
        beyond = self.palm.beyond(*self.square)[self.palm.inside]
        power = (y[part] ** 2).sum(axis=0)
        moved = {
            name: _ratio(*(_displacement(tissue, each, self.palm, rate, band)[part] for each in (x, y)))
            for name, tissue in skins.items()
        }
        rms = [_on_grid(np.sqrt((each[part] ** 2).mean(axis=0)), self.palm) for each in (x, y)]
        return PalmFidelity(
            outside=float(power[beyond].sum() / max(float(power.sum()), np.finfo(float).tiny)),
            pressure=_ratio(x[part], y[part]),
            square=_ratio(x[part][:, ~beyond], y[part][:, ~beyond]),
            displacement=MappingProxyType(moved),
            palm=self.palm.name,
            pressed=PressedPalm(wanted=rms[0], delivered=rms[1], pitch=self.palm.pitch, square=self.square),
        )

    def frames(
        self, *, judged: tuple[float, float] | None = None, band: Band = BAND, skin: str = "soft, deep"
    ) -> PalmFrames:
        """Frames at about 1 kHz of what `fidelity` compares, for display, of a skin in `physics.SKINS`."""
        x, y, part, rate = self._aligned(judged, band)
        # Scale the target to the level of the delivered pressure.
        x = x * (float((x * y).sum()) / max(float((x**2).sum()), np.finfo(float).tiny))
        moved = (_displacement(SKINS[skin], each, self.palm, rate, band) for each in (x, y))
        x, y, wanted_motion, motion = (_on_grid(each[part], self.palm) for each in (x, y, *moved))
        return PalmFrames(
            wanted=x,
            delivered=y,
            wanted_motion=wanted_motion,
            motion=motion,
            rate=rate,
            pitch=self.palm.pitch,
            square=self.square,
            skin=skin,
        )

    def _aligned(self, judged: tuple[float, float] | None, band: Band) -> tuple[Array, Array, slice, float]:
        """Both pressures in the band at one rate of about 1 kHz and aligned, the evaluated frames, and that rate."""
        # For an exact delay from the cross-correlation: eight times the band's end, 4 kHz for the paper's.
        slow = float(1000 * np.ceil(8 * band[1] / 1000))
        pairs = zip((self.wanted, self.delivered), self.rates, strict=True)
        x, y = (in_band(resample(each, rate, slow), slow, band) for each, rate in pairs)
        frames = min(len(x), len(y))
        x, y = x[:frames], y[:frames]
        every = max(1, round(slow / max(1000.0, 2.2 * band[1])))
        x, y, rate = x[::every], advance(y, find_delay(x, y, slow), slow)[::every], slow / every
        begin, duration = judged or (0.0, len(x) / rate)
        return x, y, slice(round(begin * rate), round((begin + duration) * rate)), rate


def _on_grid(values: Array, palm: Palm) -> Array:
    """Values (..., point) of the skin's points on the palm's grid, NaN beside the skin."""
    on_grid = np.full((*values.shape[:-1], *palm.inside.shape), np.nan)
    on_grid[..., palm.inside] = values
    return on_grid


def _displacement(tissue: Tissue, pressure: Array, palm: Palm, rate: float, band: Band) -> Array:
    """Displacement of the palm's skin, shape (frame, point)."""
    load = np.zeros((len(pressure), *palm.inside.shape))
    load[:, palm.inside] = pressure
    motion = skin_motion(tissue, palm.inside.shape, palm.pitch, rate, band)
    return motion.displacement(load)[:, palm.inside]


def _ratio(x: Array, y: Array) -> float:
    """Signal-to-distortion ratio of y in dB; the signal is x with the best gain."""
    power = float((x**2).sum())
    gain = float((x * y).sum()) / max(power, np.finfo(float).tiny)
    return decibels(gain**2 * power, float(((y - gain * x) ** 2).sum()))
