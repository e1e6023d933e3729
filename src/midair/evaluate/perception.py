"""Perceptual similarity of two vibrations: published metrics for skin, and Pacinian power.

ST-SIM is by Hassen and Steinbach (IEEE Trans. Haptics 13(1), 2020). It and SPQI are two of the metrics that Noll,
Hofbauer, Muschter, Li and Steinbach combine (IEEE Haptics Symposium 2022, doi 10.1109/HAPTICS52432.2022.9765599). Both
follow the package of the latter authors, vibromaf 0.0.8: blocks of 512 samples at 8 kHz, an orthonormal DCT, and the
threshold curve T below. A test compares them with numbers of vibromaf.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import ShapeError
from midair.evaluate.spectra import level

RATE = 8000.0
"""Sample rate of the published metrics in Hz."""

BLOCK = 512
"""Samples of a block of the published metrics."""


FLOOR = 77.0
"""Minimum of the published metrics' threshold curve below 0 dB, in dB."""


def metric_threshold(bins: int, rate: float = RATE) -> Array:
    """Detection threshold of the published metrics in dB at the bins of a DCT of `bins` samples, shape (bin,).

    T(f) = 62 (log10(f / 550 + b) / log10 b)^2 - 77 with b = 1 - 250 / 550 and f in Hz: the minimum is at 250 Hz. The
    curve is constant from the first frequency above it where it exceeds 0 dB. As in vibromaf, bin k is at k rate / (2
    bins - 1), 0.05 % above the DCT's own frequency, to obtain the same numbers.
    """
    frequency, b = np.arange(bins) * rate / (2 * bins - 1), 1 - 250 / 550
    curve = 62 * (np.log10(frequency / 550 + b) / np.log10(b)) ** 2 - FLOOR
    above = int(np.argmax(curve > 0))
    # Without a value above 0 dB argmax is 0: vibromaf then flattens the whole curve, but not for its block length.
    curve[above:] = curve[above] if above else curve[above:]
    return np.asarray(curve, np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class SkinModel:
    """Model of skin displacement under a cell's pressure, and of its detection threshold."""

    modulus: float = 50e3
    """Elastic modulus of skin in Pa (TouchSim: Saal et al., PNAS 114(28), 2017)."""
    poisson: float = 0.4
    """Poisson's ratio (same source)."""
    radius: float = 5e-3
    """Radius of the area under a cell's pressure, in m."""
    just_felt: float = 0.1e-6
    """Peak displacement at the detection threshold of the palm at `best`, in m. Nominal: see
    `people` for their range; this affects levels over the threshold, but no difference between two
    signals.
    """
    best: float = 250.0
    """Most sensitive frequency of Pacinian corpuscles in Hz (Verrillo, J. Acoust. Soc. Am. 35(12), 1963)."""
    below: float = 12.0
    """Rise of the threshold below `best` in dB per octave (same source)."""
    above: float = 9.0
    """Rise of the threshold above `best` in dB per octave (same source)."""
    flat_below: float = 40.0
    """Below this frequency in Hz the threshold of the thenar eminence is flat and independent of the area, a channel
    that is not Pacinian (Verrillo 1963, in Gescheider and Verrillo, doi 10.1007/978-1-4613-3039-4_10).
    """
    area: float = 2.9e-4
    """Contact area of `just_felt` in m2. From 0.02 to 2.9 cm2 the Pacinian threshold falls by 3 dB for each doubling
    (Verrillo 1963; The role of skin coupling in the determination of vibrotactile spatial summation).
    """
    people: tuple[float, float] = (-20.0, 13.0)
    """Range of thresholds in dB around `just_felt`. Lower: below .01 um in some of 19 people who grasped a cylinder
    (Brisben, Hsiao and Johnson, Detection of vibration transmitted through an object grasped in the hand, 1999).
    Upper: 2.6 dB per decade of age over 50 years (Brammer et al., 125th Meeting of the ASA, 1993, paper 4aBV9).
    """
    step: float = 1.58
    """Just noticeable difference of the level in dB: a Weber fraction of .20 of the amplitude, the median at 125
    Hz on the thenar eminence (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012).
    """

    def displacement(self, pressure: Array) -> Array:
        """Displacement of skin under a uniformly pressed disc, u = 2 (1 - nu^2) P a / E, in m; 17 µm for 100 Pa."""
        return 2 * (1 - self.poisson**2) * self.radius / self.modulus * np.asarray(pressure, float)

    @property
    def pressure_just_felt(self) -> float:
        """Peak amplitude of a cell's pressure at the detection threshold at `best`, in Pa: .6 Pa."""
        return self.just_felt / float(self.displacement(np.ones(1))[0])

    def threshold(self, frequency: Array) -> Array:
        """Pacinian threshold T_P(f) as peak displacement in m, for frequencies in Hz above 0."""
        octaves = np.log2(np.asarray(frequency, float) / self.best)
        rise = np.where(octaves < 0, -self.below * octaves, self.above * octaves)
        return self.just_felt * 10 ** (rise / 20)

    def detection_threshold(self, frequency: Array, area: float) -> Array:
        """Threshold of the more sensitive channel for a contact of `area` in m2, as peak displacement in m."""
        smaller = 10 * np.log10(self.area / np.clip(area, 0.02e-4, self.area))
        flat = self.threshold(np.array(self.flat_below))
        return np.minimum(self.threshold(frequency) * 10 ** (smaller / 20), flat)

    def metric_scale(self) -> float:
        """Factor that converts a pressure in Pa to the input of ST-SIM and SPQI.

        The metrics have no unit. With this factor a sine at `best` at the detection threshold has the minimum level of
        their threshold curve.
        """
        level = 10 ** (-FLOOR / 20) / np.sqrt(BLOCK / 2)
        return float(self.displacement(np.ones(1))[0] / self.just_felt * level)


def blocks(signal: Array) -> Array:
    """Split a signal (sample,) into whole blocks, shape (block, sample); the remainder is not used."""
    if len(signal) < BLOCK:
        raise ShapeError(
            f"signal: expected at least {BLOCK} samples ({1e3 * BLOCK / RATE:g} ms at {RATE:g} Hz), got {len(signal)}; "
            "take a longer part"
        )
    return np.asarray(signal[: len(signal) // BLOCK * BLOCK], float).reshape(-1, BLOCK)


def perceptual_spectrum(signal: Array) -> Array:
    """Level of each DCT bin of each block over the threshold: ``S = 20 log10 |DCT| - T``, shape (block, bin), in dB."""
    size = np.abs(scipy.fft.dct(blocks(signal), norm="ortho", axis=1))
    with np.errstate(divide="ignore"):
        return 20 * np.log10(size) - metric_threshold(BLOCK)


def similarities(reference: Array, distorted: Array, *, compared: NDArray[np.bool_]) -> Array:
    """ST-SIM and SPQI of the channels in the mask `compared`, shape (2, channel); NaN for the others.

    The signals (sample, ...) at 8 kHz are on one scale; the longer one is cut. Both metrics are 1 for equal signals.
    Blocks with a silent reference are ignored; vibromaf counts them as 0 in ST-SIM.

    ST-SIM is tau^(2/3) s^(1/3). tau compares the normalised blocks (zero mean, unit variance), s the supports
    Phi(S / 12) of their perceptual spectra; both are means over the blocks of sum(r d) / sum(r^2). A negative tau, for
    which vibromaf has no result, gives 0. ST-SIM is above 1 if the distorted signal is felt more than the reference.

    SPQI is the mean over the blocks of (1 - tanh(0.3 d + 2)) / 2, with ``d = 10 log10(sum |10^(Sr/10) - 10^(Sd/10)| /
    sum 10^(Sr/10))`` of the perceptual spectra Sr and Sd: differences are weighted by their level over the threshold,
    and phase is ignored. SPQI is .02 if the difference is as large as the reference.
    """
    found, frames = np.full((2, len(compared)), np.nan), min(len(reference), len(distorted))
    a, b = (each[:frames].reshape(frames, -1) for each in (reference, distorted))
    for channel in np.flatnonzero(compared):
        found[:, channel] = _similarity(a[:, channel], b[:, channel])
    return found


def _similarity(reference: Array, distorted: Array) -> tuple[float, float]:
    """ST-SIM and SPQI of one channel; for equal or silent signals 1 or 0."""
    r, d = blocks(reference), blocks(distorted)
    if np.array_equal(reference, distorted):
        return 1.0, 1.0
    spectra = [perceptual_spectrum(x) for x in (reference, distorted)]
    varies = r.std(axis=1) > 0
    temporal = _alike(_standard(r[varies]), _standard(d[varies]))
    spectral = _alike(*(scipy.special.ndtr(each[varies] / 12) for each in spectra))
    before, after = (10 ** (each / 10) for each in spectra)
    power = before.sum(axis=1)
    heard = power > 0
    apart = level(np.abs(before - after)[heard].sum(axis=1), power[heard] + np.finfo(float).eps)
    count, total = int(varies.sum()), float(np.sum((1 - np.tanh(0.3 * apart + 2.0)) / 2))
    alike = max(temporal / count, 0.0) ** (2 / 3) * (spectral / count) ** (1 / 3) if count else 0.0
    return alike, total / int(heard.sum()) if heard.any() else 0.0


def pacinian_level(pressure: Array, rate: float) -> Array:
    """Level of the power in the Pacinian channel, ``10 log10 sum |X|^2 / T_P^2``, in dB over the threshold.

    It predicts the perceived roughness of textures (Bensmaia and Hollins, Percept. Psychophys. 65(6), 2003). X are the
    peak amplitudes of the Fourier components of the whole signal without its mean. A sine at the threshold has 0 dB,
    silence minus infinity. `pressure`, shape (frame, ...), is in Pa, and `rate` in Hz.
    """
    return _weighted_level(pressure, rate, lambda f: 1 / SkinModel().threshold(f)[None] ** 2)[0]


FELT_BANDS = ((20.0, 40.0), (40.0, 150.0), (150.0, 470.0))
"""Bands in Hz of `band_levels`: not Pacinian, rising sensitivity, and the most sensitive frequencies."""


def band_levels(pressure: Array, rate: float, *, area: float) -> Array:
    """Level over the detection threshold of a palm in each of `FELT_BANDS`, in dB, shape (band, ...).

    Power is weighted by `SkinModel.detection_threshold`; pressure as in `pacinian_level`, `area` of contact in m2.
    """

    def weights(frequency: Array) -> Array:
        inside = [(frequency >= low) & (frequency < high) for low, high in FELT_BANDS]
        return np.stack(inside) / SkinModel().detection_threshold(frequency, area) ** 2

    return _weighted_level(pressure, rate, weights)


def _weighted_level(pressure: Array, rate: float, weights: Callable[[Array], Array]) -> Array:
    """Level in dB of the skin's displacement with several weights (weight, bin), shape (weight, ...)."""
    # Without 0 Hz: Pacinian corpuscles do not respond to steady pressure, and 0 Hz has no octave.
    weight = weights(np.asarray(np.fft.rfftfreq(len(pressure), 1 / rate)[1:], np.float64))
    channels = SkinModel().displacement(pressure.reshape(len(pressure), -1)).T
    power = [weight @ np.abs(np.fft.rfft(values)[1:] * 2 / len(pressure)) ** 2 for values in channels]
    return level(np.stack(power, axis=1)).reshape(-1, *pressure.shape[1:])


def _alike(reference: Array, distorted: Array) -> float:
    power = (reference**2).sum(axis=1) + np.finfo(float).eps
    return float(((reference * distorted).sum(axis=1) / power).sum())


def _standard(rows: Array) -> Array:
    return (rows - rows.mean(axis=1, keepdims=True)) / (rows.std(axis=1, keepdims=True) + np.finfo(float).eps)
