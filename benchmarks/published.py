"""Published methods under their published names, for comparison.

All return phases at equal amplitude. All but `Greedy` find only the shape of a field; `best_level` then gives the
common level with the least error. A target of 0 asks for silence at that point; no formula divides by it.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Progress
from midair.solvers.phases import hold, unit
from midair.solvers.problem import Answer, Problem, WarmStart, status_of

Complex = NDArray[np.complexfloating[Any, Any]]


class _Published(ABC):
    """A method that computes complex drives for all frames at once."""

    __slots__ = ()
    iterations: int

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases for each frame independently."""
        frames, audible = len(problem.amplitude), np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.angle(self._drives(problem)).astype(np.float64)
        made = np.zeros(frames, np.int64)
        made[audible] = self.iterations
        if progress is not None:
            progress(frames, frames)
        phase = hold(phase, audible, None if after is None else after.theta)
        return Answer(
            phase=phase,
            level=None if isinstance(self, Greedy) else best_level(problem, phase),
            iterations=made,
            status=status_of(frames, audible),
            end=WarmStart(theta=phase[-1]) if len(audible) else after,
        )

    @abstractmethod
    def _drives(self, problem: Problem) -> Complex:
        """Complex drives, shape (frame, transducer), of which only the phases matter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Naive(_Published):
    """Back-propagation of the target with all phases 0: q = arg(G^H p)."""

    iterations: int = 1

    def _drives(self, problem: Problem) -> Complex:
        return unit(problem.amplitude.astype(complex) @ problem.G.conj())


@dataclass(frozen=True, slots=True, kw_only=True)
class GerchbergSaxton(_Published):
    """GS: propagate between array and points in turn, keep the phase and replace the magnitude.

    Gerchberg & Saxton, "A practical algorithm for the determination of phase from image and diffraction plane
    pictures", Optik 35 (1972); with G^H for back-propagation as in Marzo & Drinkwater, PNAS 116 (2019).
    """

    iterations: int = 100

    def _drives(self, problem: Problem) -> Complex:
        p = problem.amplitude
        u = np.ones(p.shape, complex)
        for _ in range(self.iterations):
            u = unit(unit((p * u) @ problem.G.conj()) @ problem.G.T)
        return unit((p * u) @ problem.G.conj())


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightedGerchbergSaxton(_Published):
    """WGS: GS with weights that grow where the field is too weak: w <- w p / |y|, both relative to their means.

    Di Leonardo, Ianni & Ruocco, "Computer generation of optimal holograms for optical trap arrays", Optics Express 15
    (2007).
    """

    iterations: int = 100

    def _drives(self, problem: Problem) -> Complex:
        p = problem.amplitude
        sounding = p > 0
        w, u = p.copy(), np.ones(p.shape, complex)
        for _ in range(self.iterations):
            y = unit((w * u) @ problem.G.conj()) @ problem.G.T
            u, size = unit(y), np.abs(y)
            scale = (size * sounding).sum(axis=1, keepdims=True) / np.maximum(p.sum(axis=1, keepdims=True), 1e-300)
            w = w * np.where(sounding, scale * p / np.maximum(size, 1e-300), 0.0)
            # Only the ratios of the weights matter; without scaling they would overflow.
            w /= np.maximum(w.max(axis=1, keepdims=True), 1e-300)
        return unit((w * u) @ problem.G.conj())


@dataclass(frozen=True, slots=True, kw_only=True)
class Greedy(_Published):
    """Set one transducer after another to the phase, from a few levels, with the least error so far.

    Suzuki, Inoue, Fujiwara & Makino, "Radiated pressure field reproduction by a greedy algorithm for phased arrays",
    IEEE Trans. Haptics 14 (2021). The order is random with a fixed seed.
    """

    levels: int = 16  # Number of phases to choose from
    iterations: int = 1  # Number of passes over all transducers
    seed: int = 0

    def _drives(self, problem: Problem) -> Complex:
        choices = np.exp(2j * np.pi * np.arange(self.levels) / self.levels)
        p, G = problem.amplitude, problem.level * problem.G
        q = np.zeros((len(p), problem.transducers), complex)
        y = np.zeros(p.shape, complex)
        order = np.random.default_rng(self.seed)
        for _ in range(self.iterations):
            for n in order.permutation(problem.transducers):
                # In later passes the transducer's own contribution is removed before it chooses.
                y -= q[:, n, None] * G[:, n]
                trial = np.abs(y[:, None, :] + choices[:, None] * G[:, n])
                best = ((trial - p[:, None, :]) ** 2).sum(axis=2).argmin(axis=1)
                q[:, n] = choices[best]
                y += q[:, n, None] * G[:, n]
        return q


PUBLISHED = {"naive": Naive, "gs": GerchbergSaxton, "wgs": WeightedGerchbergSaxton, "greedy": Greedy}


def best_level(problem: Problem, theta: Array) -> Array:
    """Factor on the problem's level, 0 to 1, with the least squared error, shape (frame,)."""
    size = np.abs(problem.field(theta))
    power = np.einsum("fm,fm->f", size, size)
    fit = np.einsum("fm,fm->f", size, problem.amplitude)
    # Limited to full drive, even if a louder field would fit better.
    return np.clip(fit / np.where(power > 0, power, 1), 0, 1)
