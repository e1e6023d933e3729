"""Limits of a threshold from the profile of its likelihood, held against what the profile does in drawn data."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from midair.study.statistics.psychometric import CurveFamily

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveNet:
    """Functions on a net of places, log slopes and lapses, with the logarithms of their chances.

    Attributes
    ----------
    curves : CurveFamily
        The family that they are of.
    axes : tuple of ndarray
        Places, log slopes, lapses.
    logit, no : ndarray, shape (level, place, slope and lapse)
        Logarithms of the odds of the answer, and of the chance of none.
    """

    curves: CurveFamily
    axes: tuple[Array, Array, Array]
    logit: Array
    no: Array

    def likelihood(self, right: Array, total: Array, place: int) -> Array:
        """Logarithm of the likelihood of the functions at a place, shape (data set, slope and lapse)."""
        return right @ self.logit[:, place] + total @ self.no[:, place]

    def profile(self, right: Array, total: Array) -> Array:
        """The greatest at each place, shape (data set, place), for right answers of shape (data set, level)."""
        return np.stack([self.likelihood(right, total, i).max(axis=1) for i in range(len(self.axes[0]))], axis=1)

    def best(self, right: Array, total: Array) -> Array:
        """Place, log slope and lapse of the greatest, shape (data set, 3)."""
        place = self.profile(right, total).argmax(axis=1)
        found: list[list[float]] = []
        for row, i in zip(right, place, strict=True):
            slope, lapse = divmod(int(self.likelihood(row, total, int(i)).argmax()), len(self.axes[2]))
            found.append([float(self.axes[0][i]), float(self.axes[1][slope]), float(self.axes[2][lapse])])
        return np.array(found)


def net_around(curves: CurveFamily, right: Array, total: Array) -> CurveNet:
    """A net over all functions that the answers leave possible.

    It begins with the whole box of the family and shrinks four times to the functions whose likelihood is within
    exp(-10) of the greatest, so that it is as fine for many answers as for few.

    Parameters
    ----------
    curves : CurveFamily
        What may be fitted.
    right, total : ndarray, shape (level,)
        Answers.
    """
    box = curves.box
    net = _net(curves, box)
    for _ in range(4):
        heights = np.stack([net.likelihood(right, total, i) for i in range(len(net.axes[0]))])
        heights = heights.reshape([len(axis) for axis in net.axes])
        likely = heights > heights.max() - 10
        box = []
        for number, axis in enumerate(net.axes):
            inside = np.flatnonzero(likely.any(axis=tuple({0, 1, 2} - {number})))
            # One mesh more on either side: the likelihood may stand between two.
            box.append((float(axis[max(inside[0] - 1, 0)]), float(axis[min(inside[-1] + 1, len(axis) - 1)])))
        net = _net(curves, box)
    return net


def threshold_limits(
    net: CurveNet, right: Array, total: Array, *, rng: np.random.Generator, draws: int = 400, level: float = 0.95
) -> tuple[float, float]:
    """Limits of the threshold: those at which the likelihood ratio is no greater than chance makes it there.

    The ratio of the greatest likelihood to that with the threshold held follows chi2 for endless trials only; with 40
    to 160 it is greater. So at each threshold in question data are drawn from the best function with that threshold,
    and the ratio is held against the ratios of these data (a parametric bootstrap under the hypothesis, inverted).

    Parameters
    ----------
    net : CurveNet
        Around the answers.
    right, total : ndarray, shape (level,)
        Answers.
    rng : Generator
        Draws the data.
    draws : int
        Data sets at each threshold.
    level : float
        Confidence.

    Returns
    -------
    low, high : float
        In the unit of the levels; 0 or infinite where the net ends before the ratio is too great: the answers set no
        limit there.
    """
    from scipy.stats import chi2

    seed = int(rng.integers(2**63))
    profile = net.profile(right[None], total)[0]
    ratio = 2 * (profile.max() - profile)
    best = int(ratio.argmin())

    @cache
    def excess(place: int) -> float:
        # The same numbers at every place, so that a limit does not hang on the luck of the draw.
        return float(ratio[place] - critical_ratio(net, right, total, place, np.random.default_rng(seed), draws, level))

    found: list[float] = []
    for side, end in ((-1, 0), (1, len(profile) - 1)):
        inside, outside = best, end
        if excess(end) <= 0:
            plain = -np.inf if net.curves.shape != "weibull" else 0.0
            found.append(plain if side < 0 else np.inf)
            continue
        critical = float(chi2.ppf(level, 1))
        while abs(outside - inside) > 1:
            # Not halved: the ratio that is too great changes little from place to place, so the last one tells where.
            between = range(inside + side, outside, side)
            middle = next((place for place in between if ratio[place] > critical), between[-1])
            critical = float(ratio[middle]) - excess(middle)
            inside, outside = (inside, middle) if ratio[middle] > critical else (middle, outside)
        near, far = excess(inside), excess(outside)
        share = -near / (far - near)
        place = net.axes[0][inside] + share * (net.axes[0][outside] - net.axes[0][inside])
        found.append(net.curves.function(np.array([place, 0.0, 0.0])).threshold)
    return found[0], found[1]


def critical_ratio(
    net: CurveNet, right: Array, total: Array, place: int, rng: np.random.Generator, draws: int, level: float
) -> float:
    """The likelihood ratio that data drawn from the best function at a place do not exceed in `level` of all sets."""
    function = int(net.likelihood(right, total, place).argmax())
    chance = np.exp(net.logit[:, place, function] + net.no[:, place, function])
    data = rng.binomial(total.astype(int), chance, (draws, len(total))).astype(float)
    # Every second place is near enough to the greatest likelihood: the net is fine for the sake of the limits.
    known = net.likelihood(data, total, place).max(axis=1)
    greatest = np.max(
        [net.likelihood(data, total, i).max(axis=1) for i in range(place % 2, len(net.axes[0]), 2)], axis=0
    )
    return float(np.quantile(2 * (greatest - known), level))


def _net(curves: CurveFamily, box: list[tuple[float, float]]) -> CurveNet:
    # Coarse in slope and lapse: the drawn data are held against the same net, so that nothing leans to one side.
    places, slopes, lapses = (
        np.linspace(low, high, count) for (low, high), count in zip(box, (81, 21, 4), strict=True)
    )
    z = np.stack(np.meshgrid(places, slopes, lapses, indexing="ij")).reshape(3, -1)
    yes, no = (each.reshape(len(curves.x), len(places), -1) for each in curves.logarithms(z))
    return CurveNet(curves=curves, axes=(places, slopes, lapses), logit=yes - no, no=no)
