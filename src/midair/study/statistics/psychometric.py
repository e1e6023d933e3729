"""Psychometric functions: the probability of an answer as a function of stimulus level."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from midair.array_types import Array
from midair.errors import InputError

CurveShape = Literal["logistic", "normal", "weibull"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Psychometric:
    """psi(x) = guess + (1 - guess - lapse) F(x)."""

    threshold: float
    """In the unit of x: F is 1/2 there for "logistic" and "normal", 1 - 1/e for "weibull"."""
    slope: float
    """"logistic": F = 1 / (1 + exp(-slope (x - threshold))); "normal": Phi(slope (x - threshold)); "weibull": 1 -
    exp(-(x / threshold)^slope)."""
    guess: float = 0.0
    """Guess rate; 1/m with m alternatives."""
    lapse: float = 0.0
    """Lapse rate."""
    shape: CurveShape = "logistic"
    """Shape of F."""

    def __post_init__(self) -> None:
        if self.shape not in get_args(CurveShape):
            raise InputError(f"shape: expected one of {', '.join(get_args(CurveShape))}, got {self.shape!r}")
        if min(self.guess, self.lapse) < 0 or self.guess + self.lapse >= 1:
            raise InputError(f"guess and lapse: expected 0 or more, together below 1, got {self.guess}, {self.lapse}")

    def probability(self, level: Any) -> Array:
        """Probability of the answer at each level, same shape."""
        return self.guess + (1 - self.guess - self.lapse) * sigmoid(level, self.threshold, self.slope, self.shape)


def sigmoid(level: Any, threshold: Any, slope: Any, shape: CurveShape) -> Array:
    """F of `Psychometric`, 0 to 1; all arguments broadcast."""
    from scipy.special import expit, ndtr

    x = np.asarray(level, float)
    if shape == "weibull":
        with np.errstate(divide="ignore"):
            rise = slope * np.log(np.maximum(x, 0) / threshold)
        # F is exactly 1 in float64 well below 50; far above 50 the exponential overflows.
        return np.asarray(-np.expm1(-np.exp(np.minimum(rise, 50))))
    z = slope * (x - threshold)
    return np.asarray(expit(z) if shape == "logistic" else ndtr(z))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveFamily:
    """Functions that may be fitted, with the parameters place (rescaled or log threshold), log slope and lapse."""

    x: Array
    """Levels in rising order, shape (level,)."""
    guess: float
    lapse_most: float
    shape: CurveShape

    @property
    def box(self) -> list[tuple[float, float]]:
        """Bounds of place, log slope and lapse."""
        top = np.log(max(float(self.x.max()), 1e-12))
        place = (top - 8, top + 3) if self.shape == "weibull" else (-2.0, 3.0)
        return [place, (-3.0, 6.0), (0.0, self.lapse_most)]

    def function(self, z: Array) -> Psychometric:
        """Function with these three parameters."""
        threshold, slope = (float(each) for each in self._unpack(z[0], z[1]))
        return Psychometric(
            threshold=threshold, slope=slope, guess=self.guess, lapse=float(np.clip(z[2], 0, 1)), shape=self.shape
        )

    def logarithms(self, z: Array) -> tuple[Array, Array]:
        """Log probabilities of the answer and of its absence, shape (level, ...) for z of shape (3, ...)."""
        threshold, slope = self._unpack(z[0], z[1])
        x = self.x.reshape(-1, *[1] * (z.ndim - 1))
        p = self.guess + (1 - self.guess - z[2]) * sigmoid(x, threshold, slope, self.shape)
        # Answers of probability 0 get a large but finite log loss.
        p = np.clip(p, 1e-9, 1 - 1e-9)
        return np.log(p), np.log1p(-p)

    def place(self, threshold: float) -> float:
        """Place parameter of a threshold."""
        if self.shape == "weibull":
            return float(np.log(threshold))
        return (threshold - float(self.x[0])) / self._span

    def _unpack(self, place: Any, slope: Any) -> tuple[Any, Any]:
        if self.shape == "weibull":
            return np.exp(place), np.exp(slope)
        return self.x[0] + self._span * place, np.exp(slope) / self._span

    @property
    def _span(self) -> float:
        return float(np.ptp(self.x)) or 1.0
