"""How alike two vibrations feel: published similarity metrics for skin, and the power that Pacinian corpuscles take up.

ST-SIM is of Hassen and Steinbach (IEEE Trans. Haptics 13(1), 2020); it and SPQI are two of the metrics that Noll,
Hofbauer, Muschter, Li and Steinbach fuse (IEEE Haptics Symposium 2022, doi 10.1109/HAPTICS52432.2022.9765599). Both are
here in the reading of the latter's package, vibromaf 0.0.8: blocks of 512 samples at 8 kHz, an orthonormal DCT, and the
threshold curve T below. A test holds them to vibromaf's numbers.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import ShapeError
from midair.evaluate.spectrum import long_stretches
from midair.lazy_frames import LazyFrames, read_frames

Array = NDArray[np.float64]

RATE = 8000.0
"""Samples per second that the published metrics are defined for, in Hz."""

_STRETCH = 2**19
"""Numbers whose blocks are looked at together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """The metrics' curve of what is just felt: T(f) = span (log10(f / slope + b) / log10 b)^2 - floor, in dB.

    b = 1 - lowest / slope, so that the curve is lowest at `lowest`. From the first frequency above `lowest` where it
    passes 0 dB it stays there.

    Attributes
    ----------
    lowest : float
        Where skin is most sensitive, in Hz.
    slope : float
        In Hz.
    span : float
        Distance from the least value to that at 0 Hz, in dB.
    floor : float
        Least value below 0 dB, in dB.
    """

    lowest: float = 250.0
    slope: float = 550.0
    span: float = 62.0
    floor: float = 77.0

    def at(self, bins: int, rate: float = RATE) -> Array:
        """The curve at the bins of a DCT of `bins` samples, shape (bin,), in dB.

        vibromaf puts bin k at k rate / (2 bins - 1), half a part in a thousand above the DCT's own frequency; so does
        this, for the same numbers.
        """
        frequency = np.arange(bins) * rate / (2 * bins - 1)
        b = 1 - self.lowest / self.slope
        curve = self.span * (np.log10(frequency / self.slope + b) / np.log10(b)) ** 2 - self.floor
        above = int(np.argmax(curve > 0))
        # argmax of nothing is 0: vibromaf then flattens the whole curve, which no block of its length ever meets.
        curve[above:] = curve[above] if above else curve[above:]
        return np.asarray(curve, np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class SkinModel:
    """A model from the pressure on a cell to what skin does, and what of it is felt.

    Attributes
    ----------
    modulus : float
        Elastic modulus of skin, in Pa (TouchSim: Saal et al., PNAS 114(28), 2017).
    poisson : float
        Poisson's ratio (the same).
    radius : float
        Radius of the area that a cell's pressure acts on, in m.
    just_felt : float
        Peak displacement that is just felt at `best` on the palm, in m. Nominal: thresholds differ between people by
        10 dB and with the area; only levels over the threshold depend on it, no difference between two signals.
    best : float
        Frequency that Pacinian corpuscles feel best, in Hz (Verrillo, J. Acoust. Soc. Am. 35(12), 1963).
    below, above : float
        By how much the threshold rises away from `best`, in dB an octave (the same).
    step : float
        Just noticeable difference of the level, in dB: a Weber fraction of .20 of the amplitude, the median for
        125 Hz on the thenar eminence (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012).
    """

    modulus: float = 50e3
    poisson: float = 0.4
    radius: float = 5e-3
    just_felt: float = 0.1e-6
    best: float = 250.0
    below: float = 12.0
    above: float = 9.0
    step: float = 1.58

    def displacement(self, pressure: Array) -> Array:
        """Displacement of skin amid an evenly pressed disc, u = 2 (1 - nu^2) P a / E, in m; 100 Pa make 17 µm."""
        return 2 * (1 - self.poisson**2) * self.radius / self.modulus * np.asarray(pressure, float)

    @property
    def pressure_just_felt(self) -> float:
        """Pressure on a cell that swings just enough to be felt at `best`, from its mean to its peak, in Pa: .6 Pa."""
        return self.just_felt / float(self.displacement(np.ones(1))[0])

    def threshold(self, frequency: Array) -> Array:
        """Pacinian threshold T_P(f), peak displacement in m, shape of `frequency` (Hz, above 0)."""
        octaves = np.log2(np.asarray(frequency, float) / self.best)
        rise = np.where(octaves < 0, -self.below * octaves, self.above * octaves)
        return self.just_felt * 10 ** (rise / 20)

    def metric_scale(self, block: int = 512) -> float:
        """What to multiply a pressure in Pa by before ST-SIM and SPQI.

        The metrics know no unit. With this factor a sine at `best` that is just felt has the level of their threshold
        curve's least value.
        """
        level = 10 ** (-Threshold().floor / 20) / np.sqrt(block / 2)
        return float(self.displacement(np.ones(1))[0] / self.just_felt * level)


def blocks(signal: Array, block: int = 512) -> Array:
    """Whole blocks of a signal (sample,), shape (block, sample); what is left over at the end is not used.

    Raises
    ------
    ShapeError
        If there is not one whole block.
    """
    if len(signal) < block:
        raise ShapeError(
            f"signal: expected at least {block} samples ({1e3 * block / RATE:g} ms at {RATE:g} Hz), got {len(signal)}; "
            "take a longer part"
        )
    return np.asarray(signal[: len(signal) // block * block], float).reshape(-1, block)


def perceptual_spectrum(signal: Array, *, block: int = 512) -> Array:
    """Level over the threshold of each bin of each block: ``S = 20 log10 |DCT| - T``, shape (block, bin), in dB."""
    from scipy.fft import dct

    size = np.abs(dct(blocks(signal, block), norm="ortho", axis=1))
    with np.errstate(divide="ignore"):
        return 20 * np.log10(size) - Threshold().at(block)


def st_sim(reference: Array, distorted: Array, *, eta: float = 2 / 3, block: int = 512) -> float:
    """Spectral and temporal similarity: tau^eta s^(1 - eta).

    tau compares the blocks with their means and sizes taken away, s the supports Phi(S / 12) of their perceptual
    spectra; both by the mean over the blocks of sum(r d) / sum(r^2). Blocks in which the reference is silent say
    nothing and are left out. vibromaf counts them as 0, and has no value where tau is negative, which is 0 here.

    Parameters
    ----------
    reference, distorted : ndarray, shape (sample,)
        Signals at 8 kHz, on one scale; the longer one is cut.
    eta : float
        Weight of time against spectrum.

    Returns
    -------
    float
        1 for the same, 0 for nothing alike; above 1 where more is felt than in the reference.
    """
    return _over_stretches(reference, distorted, block, lambda: _StSim(eta=eta, block=block))


def spqi(reference: Array, distorted: Array, *, eta: float = 0.3, threshold: float = -2.0, block: int = 512) -> float:
    """Spectral perceptual quality index: the mean over the blocks of (1 - tanh(eta d - threshold)) / 2.

    ``d = 10 log10(sum |10^(Sr/10) - 10^(Sd/10)| / sum 10^(Sr/10))`` with the perceptual spectra Sr of the reference and
    Sd of what is compared with it: differences count by how far they are over the threshold, whatever their phase.
    Blocks in which the reference is silent are left out.

    Parameters
    ----------
    reference, distorted : ndarray, shape (sample,)
        Signals at 8 kHz, on one scale; the longer one is cut.

    Returns
    -------
    float
        1 for the same; .02 where the difference is as large as the reference.
    """
    return _over_stretches(reference, distorted, block, lambda: _Spqi(eta=eta, threshold=threshold, block=block))


def similarities(
    reference: Array | LazyFrames, distorted: Array | LazyFrames, *, compared: NDArray[np.bool_], block: int = 512
) -> Array:
    """ST-SIM and SPQI, shape (2, channel), of the channels that are to be compared; NaN of the others.

    Parameters
    ----------
    reference, distorted : ndarray or Reel, shape (sample, ...)
        Signals at 8 kHz, on one scale; the longer one is cut. They are read once.
    compared : ndarray of bool, shape (channel,)
        Which channels.
    """
    those, found = np.flatnonzero(compared), np.full((2, len(compared)), np.nan)
    sums = [(_StSim(block=block), _Spqi(block=block)) for _ in those]
    for x, y in _stretches(reference, distorted, block):
        a, b = x.reshape(len(x), -1), y.reshape(len(y), -1)
        for channel, both in zip(those, sums, strict=True):
            for each in both:
                each.add(a[:, channel], b[:, channel])
    for channel, (temporal, spectral) in zip(those, sums, strict=True):
        found[:, channel] = temporal.value, spectral.value
    return found


def _over_stretches(reference: Array, distorted: Array, block: int, begin: Callable[[], "_StSim | _Spqi"]) -> float:
    found = begin()
    for each, other in _stretches(np.asarray(reference, float), np.asarray(distorted, float), block):
        found.add(each, other)
    return found.value


class _StSim:
    """What is added up for ST-SIM, stretch by stretch."""

    def __init__(self, *, eta: float = 2 / 3, block: int = 512) -> None:
        self._eta, self._block = eta, block
        self._temporal, self._spectral, self._count, self._same = 0.0, 0.0, 0, True

    def add(self, reference: Array, distorted: Array) -> None:
        """Whole blocks of both."""
        from scipy.special import ndtr

        r, d = blocks(reference, self._block), blocks(distorted, self._block)
        heard = r.std(axis=1) > 0
        self._temporal += _alike(_standard(r[heard]), _standard(d[heard]))
        felt = (ndtr(perceptual_spectrum(x, block=self._block)[heard] / 12) for x in (reference, distorted))
        self._spectral += _alike(*felt)
        self._count += int(heard.sum())
        self._same = self._same and np.array_equal(reference, distorted)

    @property
    def value(self) -> float:
        """Of all that was added."""
        if self._same or not self._count:
            return float(self._same)
        temporal, spectral = self._temporal / self._count, self._spectral / self._count
        return float(max(temporal, 0.0) ** self._eta * spectral ** (1 - self._eta))


class _Spqi:
    """What is added up for SPQI, stretch by stretch."""

    def __init__(self, *, eta: float = 0.3, threshold: float = -2.0, block: int = 512) -> None:
        self._eta, self._threshold, self._block = eta, threshold, block
        self._total, self._count, self._same = 0.0, 0, True

    def add(self, reference: Array, distorted: Array) -> None:
        """Whole blocks of both."""
        r, d = (10 ** (perceptual_spectrum(x, block=self._block) / 10) for x in (reference, distorted))
        power = r.sum(axis=1)
        heard = power > 0
        with np.errstate(divide="ignore"):
            apart = 10 * np.log10(np.abs(r - d)[heard].sum(axis=1) / (power[heard] + np.finfo(float).eps))
        self._total += float(np.sum((1 - np.tanh(self._eta * apart - self._threshold)) / 2))
        self._count += int(heard.sum())
        self._same = self._same and np.array_equal(reference, distorted)

    @property
    def value(self) -> float:
        """Of all that was added."""
        if self._same or not self._count:
            return float(self._same)
        return self._total / self._count


def pacinian_level(pressure: Array | LazyFrames, rate: float, skin: SkinModel | None = None) -> Array:
    """Level of the power that Pacinian corpuscles take up, ``10 log10 sum |X|^2 / T_P^2``, in dB over the threshold.

    Bensmaia and Hollins (Percept. Psychophys. 65(6), 2003) found that it orders how rough textures feel. X are the peak
    amplitudes of the whole signal's Fourier components without its mean; of long signals the mean power of stretches is
    taken, see `midair.evaluate.spectrum.long_stretches`.

    Parameters
    ----------
    pressure : ndarray, shape (frame, ...)
        In Pa.
    rate : float
        In Hz.

    Returns
    -------
    ndarray, shape (...)
        In dB; a just-felt sine at any frequency is 0 dB, silence is minus infinity.
    """
    skin = skin or SkinModel()
    parts = long_stretches(len(pressure))
    frames = parts[0][1]
    # Without the mean: Pacinian corpuscles do not feel steady pressure, and it has no octave.
    frequency = np.fft.rfftfreq(frames, 1 / rate)[1:]
    weight = 1 / skin.threshold(np.asarray(frequency, np.float64)) ** 2
    power = np.zeros(int(np.prod(pressure.shape[1:], dtype=np.int64)))
    for first, last in parts:
        for channel, values in enumerate(read_frames(pressure, first, last).reshape(frames, -1).T):
            spectrum = np.fft.rfft(skin.displacement(values))[1:] * 2 / frames
            power[channel] += weight @ np.abs(spectrum) ** 2
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(power / len(parts)), np.float64).reshape(pressure.shape[1:])


def _alike(reference: Array, distorted: Array) -> float:
    """Sum over the blocks of how alike they are."""
    power = (reference**2).sum(axis=1) + np.finfo(float).eps
    return float(((reference * distorted).sum(axis=1) / power).sum())


def _standard(rows: Array) -> Array:
    return (rows - rows.mean(axis=1, keepdims=True)) / (rows.std(axis=1, keepdims=True) + np.finfo(float).eps)


def _stretches(
    reference: Array | LazyFrames, distorted: Array | LazyFrames, block: int
) -> Iterator[tuple[Array, Array]]:
    """Two signals in stretches of whole blocks, four megabytes each; the first one holds the end of a short signal."""
    frames = min(len(reference), len(distorted))
    whole = max(frames // block, 1) * block
    step = max(1, _STRETCH // int(np.prod(reference.shape[1:], dtype=np.int64)) // block) * block
    for first in range(0, whole, step):
        last = min(first + step, whole, frames)
        yield read_frames(reference, first, last), read_frames(distorted, first, last)
