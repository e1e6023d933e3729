"""The problem that every solver solves: |G q| = p with all transducers equally loud (paper, 2.3 and 4.2).

Unknowns are one vector x = [theta, psi]: the phase theta_n of each transducer and the phase psi_m that the field is
to have at each control point, which the paper leaves free. With q = A exp(j theta) and u = exp(j psi) the residual is
G q - diag(p) u, paper eq. (5). It counts as 2M real numbers, real parts first.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress, Status
from midair.physics import relative_error
from midair.solvers.terms import CellTarget, GuardField

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

Start = Literal["previous", "zero"]
"""Where a frame starts: at the phases of the frame before it, or at zero; the first frame starts at zero."""

Term = Literal["guard", "cells", "smooth", "amplitudes", "robust", "quiet-ears", "quiet-palm"]
"""What a problem may ask for beside the paper's error."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """One transfer matrix and the targets to meet with it.

    Attributes
    ----------
    G : ndarray of complex, shape (point, transducer)
        Field of each transducer at full drive, in units of the strongest focus (`physics.focus_amplitude`), so that
        tolerances mean the same for any array.
    amplitude : ndarray, shape (frame, point)
        p, wanted magnitude of the field, in the same unit.
    level : float
        A, the drive of every transducer, 0 to 1.
    psi : ndarray, shape (point,), or None
        Phases of the field, in rad, that a solver may start from; see `lens.spreading_phase`. Zero if None.
    guard : GuardField, optional
        Points around the square that are to stay quiet; see `terms.guard`.
    cells : CellTarget, optional
        What the cells of the sensor are to read, in place of the field at the points; see `terms.cells`. `amplitude`
        still says which frames are silent, and what to start from.
    smooth : float
        Weight of the change of phase from frame to frame; see `terms.smooth`.
    position : ndarray, shape (transducer, 3), or None
        Where the transducers are, in m, for methods that look at an even part of them; their order tells if None.
    """

    G: Complex
    amplitude: Array
    level: float = 1.0
    psi: Array | None = None
    guard: GuardField | None = None
    cells: CellTarget | None = None
    smooth: float = 0.0
    position: Array | None = None

    @property
    def terms(self) -> frozenset[Term]:
        """What is asked for beside the paper's error."""
        asked: dict[Term, bool] = {
            "guard": self.guard is not None,
            "cells": self.cells is not None,
            "smooth": self.smooth > 0,
        }
        return frozenset(term for term, there in asked.items() if there)

    @property
    def first_psi(self) -> Array:
        """Phases of the field to start from, shape (point,), in rad."""
        return np.zeros(self.points) if self.psi is None else self.psi

    @cached_property
    def gram(self) -> Complex:
        """A^2 G G^H, shape (point, point): the part of J J^T that no phase changes."""
        return self.level**2 * (self.G @ self.G.conj().T)

    @property
    def points(self) -> int:
        """Number of control points, M."""
        return self.G.shape[0]

    @property
    def transducers(self) -> int:
        """Number of transducers, N."""
        return self.G.shape[1]

    def field(self, theta: Array) -> Complex:
        """G q, shape (point,) for theta of shape (transducer,), or (frame, point) for (frame, transducer)."""
        return (self.level * np.exp(1j * theta)) @ self.G.T


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What a solver found.

    Attributes
    ----------
    phase : ndarray, shape (frame, transducer)
        theta, in rad, any multiple of 2 pi.
    iterations : ndarray of int, shape (frame,)
        Number of iterations that were made.
    status : tuple of {"converged", "iterations", "stalled", "silent"}
        One a frame.
    level : ndarray, shape (frame,), or None
        Part of the problem's level that each frame is played at, for methods that know only the shape of a field;
        all of it if None.
    end : End or None
        What the next part of a recording goes on from; None while nothing has sounded.
    """

    phase: Array
    iterations: NDArray[np.int64]
    status: tuple[Status, ...]
    level: Array | None = None
    end: "WarmStart | None" = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WarmStart:
    """What the frames after a part of a recording go on from; only the method that made it knows more of it.

    Attributes
    ----------
    theta : ndarray, shape (transducer,)
        Phases of the last frame that sounds, in rad: what silent frames after it keep.
    known : object
        What else the method goes on from; None where nothing.
    """

    theta: Array
    known: Any = None


class Solver(Protocol):
    """Settings only; frozen. It never raises for not converging and never returns NaN."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Phases for each frame of the problem, which goes on from where the part before it ended."""
        ...


def status_of(frames: int, audible: NDArray[np.int64]) -> tuple[Status, ...]:
    """Status of frames by a method with a fixed number of iterations: "iterations" where something sounds."""
    heard = set(audible.tolist())
    return tuple("iterations" if frame in heard else "silent" for frame in range(frames))


def error_of(problem: Problem, theta: Array, level: Array | None = None) -> Array:
    """``E = || |G q| - p || / || p ||`` of each frame, shape (frame,); 0 where p is zero, which is played as silence.

    The paper prints a factor 1/M in front, with which its 5 to 15 % would be .02 to .06 %; it is left out. Where the
    cells of the sensor are the target, it is their error: ``|| w |G q|^2 - P || / || P ||``.

    Parameters
    ----------
    problem : Problem
        G, p and A.
    theta : ndarray, shape (frame, transducer)
        Phases, in rad.
    level : ndarray, shape (frame,) or (frame, transducer), optional
        Part of the problem's level; all of it if None.
    """
    if level is None:
        field = np.abs(problem.field(theta))
    elif level.ndim == 2:
        field = np.abs((problem.level * level * np.exp(1j * theta)) @ problem.G.T)
    else:
        field = level[:, None] * np.abs(problem.field(theta))
    return error_of_field(problem, field)


def error_of_field(problem: Problem, field: Array) -> Array:
    """The error of `error_of` for the magnitude of the field at the control points, shape (frame, point)."""
    if problem.cells is not None:
        # What the cells of a silent frame were to read does not count: it is played as silence.
        return problem.cells.error(field) * problem.amplitude.any(axis=1)
    # A silent target is played as silence, whatever its phases are.
    return np.where(problem.amplitude.any(axis=1), relative_error(field, problem.amplitude), 0.0)


def residual(problem: Problem, p: Array, x: Array) -> Complex:
    """G q - diag(p) u of eq. (5), shape (point,), for one target p (point,) and x = [theta, psi]."""
    theta, psi = x[: problem.transducers], x[problem.transducers :]
    return problem.field(theta) - p * np.exp(1j * psi)


def jacobian(problem: Problem, p: Array, x: Array) -> Array:
    """Derivative of [Re; Im] of the residual by x, shape (2 point, transducer + point).

    The plain form, for tests and for the primal step: d/d theta_n = j A G_mn exp(j theta_n), d/d psi_m = -j p_m u_m.
    """
    theta, psi = x[: problem.transducers], x[problem.transducers :]
    slopes = np.hstack([1j * problem.level * problem.G * np.exp(1j * theta), np.diag(-1j * p * np.exp(1j * psi))])
    return np.vstack([slopes.real, slopes.imag]).astype(np.float64)
