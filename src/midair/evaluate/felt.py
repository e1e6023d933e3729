"""By how many of ten people a vibration is felt: the one path from pressure to detection thresholds.

The pressure moves four models of skin (`physics.SKINS`). In each, the displacement is weighted by the threshold of each
tactile channel (`physics.TOUCH_CHANNELS`), which averages its power over time and, if Pacinian, sums it over an area,
as published thresholds fall with duration and area of contact. The strongest place, moment and channel count.
People differ by `PEOPLE`. None of this was tried on people with this array.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from midair.array_types import Array
from midair.dsp import Band, resample
from midair.evaluate.distortion import in_band
from midair.model import BAND
from midair.physics import SKINS, TOUCH_CHANNELS, SkinMotion, Tissue, TouchChannel
from midair.validation import PITCHES, frozen_array, within

PEOPLE = 8.0
"""Standard deviation of the thresholds of people in dB, assumed to be normal. Published ones lie from 20 dB below the
nominal one (under .01 um in some of 19 people who grasped a cylinder: Brisben, Hsiao and Johnson 1999, Detection of
vibration transmitted through an object grasped in the hand) to 13 dB above it (2.6 dB per decade of age over 50 years:
Brammer et al., 125th Meeting of the ASA, 1993, 4aBV9); these 33 dB are taken as the range of 95 % of people."""

LONGEST = 2.0
"""Duration in s of the part with the most power in the band that is examined in a longer signal."""

JUST_FELT: Mapping[str, float] = MappingProxyType(
    {"soft, deep": 1.4, "soft, on bone": 1.5, "stiff, deep": 2.1, "stiff, on bone": 2.0}
)
"""Peak amplitude in Pa of a vibration of 250 Hz on a disc of 2.9 cm2 that half of all people feel, by skin: what `felt`
finds (a test computes it)."""

HARDLY_FELT = 1.3 * 10 ** (-1.645 * PEOPLE / 20)
"""Peak amplitude in Pa below which fewer than one of 20 people feel any vibration: half of them feel 1.3 Pa of 200 Hz
on 2.9 cm2 of soft skin on bone, the least of the frequencies, areas and skins of `docs/felt_tables.py`."""

_THIRDS = 10 ** (np.arange(12.5, 28) / 10)
"""Edges of the third octaves around 20 to 500 Hz, in Hz."""

_FINEST, _RATE, _SETTLE = 4e-3, 1000.0, 0.1
"""Largest distance in m of the points on the skin, their sample rate in Hz, and length of the skin's response in s."""
_RADIUS = float(np.sqrt(max(each.summed for each in TOUCH_CHANNELS.values()) / np.pi))


@dataclass(frozen=True, slots=True, kw_only=True)
class Felt:
    """Level of a vibration over the detection threshold, and the people who feel it."""

    levels: Mapping[str, float]
    """Level in dB over the threshold of half of all people, by skin; minus infinity for silence."""
    shares: tuple[float, ...] = ()
    """Share of each third octave in the power over the threshold, mean of the skins; empty if it is unknown."""

    @property
    def level(self) -> float:
        """Mean of the levels in dB."""
        return float(np.mean(list(self.levels.values())))

    @property
    def people(self) -> tuple[int, int, int]:
        """How many of ten people feel it: mean of the skins, fewest and most."""
        found = [10 * float(scipy.special.ndtr(level / PEOPLE)) for level in self.levels.values()]
        return round(sum(found) / len(found)), round(min(found)), round(max(found))

    def at(self, change: float) -> "Felt":
        """The same vibration with another level, `change` in dB of pressure."""
        return replace(self, levels=MappingProxyType({name: level + change for name, level in self.levels.items()}))

    def elsewhere(self, original: "Felt") -> float:
        """Share of the felt power that lies in other third octaves than that of `original`, from 0 to 1.

        Third octaves that fewer than one of 20 people feel in both vibrations are ignored, such as quiet noise.
        """
        a, b = (np.array(each.shares) for each in (self, original))
        kept = [10 ** (each.level / 10) * x >= 10 ** (-0.1645 * PEOPLE) for each, x in ((self, a), (original, b))]
        a, b = (np.where(kept[0] | kept[1], x, 0.0) for x in (a, b))
        return float(abs(a / (a.sum() or 1) - b / (b.sum() or 1)).sum() / 2)

    def __str__(self) -> str:
        about, fewest, most = self.people
        spread = "" if fewest == most else f"{fewest} to {most}; "
        return f"by about {about} of 10 people ({spread}model of skin)"

    def plain(self) -> dict[str, object]:
        """Values for JSON; silence is null."""
        about, fewest, most = self.people
        levels = {name: level if np.isfinite(level) else None for name, level in self.levels.items()}
        return {"of_ten": about, "fewest": fewest, "most": most, "over_threshold_db": levels}


def felt(pressure: Array, rate: float, pitch: float, *, skins: Mapping[str, Tissue] = SKINS) -> Felt:
    """Compute by how many people a pressure on a palm is felt as vibration.

    `pressure`, shape (frame, row, column), is in Pa, on squares of side `pitch` in m; it is 0 beyond them, and its mean
    over time is ignored, since steady pressure is no vibration. `rate` is in Hz. Raises InputError for other values.
    """
    within(rate, "rate", 2 * BAND[0], unit="Hz")
    within(pitch, "pitch", *PITCHES, unit="m")
    values = frozen_array(_loudest(pressure, rate), "pressure", ("frame", "row", "column"))
    values = resample(values - values.mean(axis=0), rate, _RATE)
    times = int(np.ceil(pitch / _FINEST - 1e-9))
    beyond = int(np.ceil(_RADIUS * times / pitch))
    # The skin also moves beside the pressure.
    load = np.pad(values.repeat(times, axis=1).repeat(times, axis=2), ((0, 0), (beyond,) * 2, (beyond,) * 2))
    found = list[list[tuple[float, Array]]]()
    for tissue in skins.values():
        moved = skin_motion(tissue, load.shape[1:], pitch / times, _RATE, BAND, _SETTLE).displacement(load)
        found.append([_level(moved, channel, pitch / times) for channel in TOUCH_CHANNELS.values()])
    powers = np.array([[thirds for _, thirds in each] for each in found]).sum(axis=1)
    shares = (powers / np.maximum(powers.sum(axis=1, keepdims=True), np.finfo(float).tiny)).mean(axis=0)
    levels = (max(level for level, _ in each) for each in found)
    return Felt(levels=MappingProxyType(dict(zip(skins, levels, strict=True))), shares=tuple(shares.tolist()))


@cache
def skin_motion(
    tissue: Tissue, shape: tuple[int, int], pitch: float, rate: float, band: Band, settle: float = 0.25
) -> SkinMotion:
    """Skin model on a grid; cached, because building it takes longer than using it."""
    return SkinMotion.of(tissue, shape, pitch=pitch, rate=rate, band=band, edge=band[0] / 2, settle=settle)


def _loudest(pressure: Array, rate: float) -> Array:
    """Part of `LONGEST` with the most power in the band."""
    frames = round(LONGEST * rate)
    if len(pressure) <= frames:
        return pressure
    power = (in_band(pressure, rate, BAND) ** 2).reshape(len(pressure), -1).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(power)])
    first = int(np.argmax(total[frames:] - total[:-frames]))
    return pressure[first : first + frames]


def _level(moved: Array, channel: TouchChannel, pitch: float) -> tuple[float, Array]:
    """Highest level in dB over the threshold of a channel, and the third octaves' parts of the power of this level.

    `moved` is a displacement in m, shape (frame, row, column).
    """
    frequency = scipy.fft.rfftfreq(len(moved), 1 / _RATE)
    weight = channel.weight(frequency) / channel.just_felt
    spectrum = scipy.fft.rfft(moved, axis=0) * weight[:, None, None]
    thirds, _ = np.histogram(frequency, _THIRDS, weights=(np.abs(spectrum) ** 2).sum(axis=(1, 2)))
    power = scipy.fft.irfft(spectrum, len(moved), axis=0) ** 2
    window = min(round(channel.averaged * _RATE), len(power))
    total = np.concatenate([np.zeros_like(power[:1]), np.cumsum(power, axis=0)])
    # Four windows in the time of one.
    begin = np.unique(np.append(np.arange(0, len(power) - window + 1, max(1, window // 4)), len(power) - window))
    mean = (total[begin + window] - total[begin]) / window
    if channel.summed:
        reach = int(_RADIUS // pitch)
        place = pitch * np.arange(-reach, reach + 1)
        disc = (place**2 + place[:, None] ** 2 < channel.summed / np.pi).astype(float)
        # At most the area that the channel sums.
        disc *= min(1.0, channel.summed / (disc.sum() * pitch**2)) * pitch**2 / channel.summed
        wider = np.pad(mean, ((0, 0), (reach, reach), (reach, reach)))
        mean = np.einsum("tyxab,ab->tyx", sliding_window_view(wider, disc.shape, axis=(1, 2)), disc)
    top = float(mean.max())
    return float(10 * np.log10(2 * top)) if top > 0 else float("-inf"), thirds * (2 * top / (thirds.sum() or 1.0))
