"""Perceptual similarity of two vibrations: published metrics for skin.

ST-SIM is by Hassen and Steinbach (IEEE Trans. Haptics 13(1), 2020). It and SPQI are two of the metrics that Noll,
Hofbauer, Muschter, Li and Steinbach combine (IEEE Haptics Symposium 2022, doi 10.1109/HAPTICS52432.2022.9765599). Both
follow the package of the latter authors, vibromaf 0.0.8: blocks of 512 samples at 8 kHz, an orthonormal DCT, and the
threshold curve T below. A test compares them with numbers of vibromaf.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import ShapeError
from midair.evaluate.felt import JUST_FELT

RATE = 8000.0
"""Sample rate of the published metrics in Hz."""

BLOCK = 512
"""Samples of a block of the published metrics."""

SILENT = 1e-3
"""A block of this part of the strongest one's amplitude is silent: a filter leaves that of a signal which has ended."""

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


def level(power: Array, reference: Array | float = 1.0) -> Array:
    """10 log10(power / reference) in dB, same shape: infinite or NaN for silence."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(10 * np.log10(power / reference), np.float64)


METRIC_SCALE = 10 ** (-FLOOR / 20) / np.sqrt(BLOCK / 2) / np.exp(np.mean(np.log(list(JUST_FELT.values()))))
"""Factor that converts a pressure in Pa to the input of ST-SIM and SPQI, which has no unit: a sine of 250 Hz that half
of all people feel (`JUST_FELT`, mean of the skins) has the minimum level of their threshold curve."""


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
    Blocks with a silent reference (`SILENT`) are ignored; vibromaf counts them as 0 in ST-SIM.

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
    varies = r.std(axis=1) > SILENT * r.std(axis=1).max()
    temporal = _alike(_standard(r[varies]), _standard(d[varies]))
    spectral = _alike(*(scipy.special.ndtr(each[varies] / 12) for each in spectra))
    before, after = (10 ** (each / 10) for each in spectra)
    power = before.sum(axis=1)
    heard = power > SILENT**2 * power.max()
    apart = level(np.abs(before - after)[heard].sum(axis=1), power[heard] + np.finfo(float).eps)
    count, total = int(varies.sum()), float(np.sum((1 - np.tanh(0.3 * apart + 2.0)) / 2))
    alike = max(temporal / count, 0.0) ** (2 / 3) * (spectral / count) ** (1 / 3) if count else 0.0
    return alike, total / int(heard.sum()) if heard.any() else 0.0


def _alike(reference: Array, distorted: Array) -> float:
    power = (reference**2).sum(axis=1) + np.finfo(float).eps
    return float(((reference * distorted).sum(axis=1) / power).sum())


def _standard(rows: Array) -> Array:
    return (rows - rows.mean(axis=1, keepdims=True)) / (rows.std(axis=1, keepdims=True) + np.finfo(float).eps)
