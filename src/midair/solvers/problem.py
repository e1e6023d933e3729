"""The problem that every solver solves: |G q| = p with equal amplitude for all transducers (paper, 2.3 and 4.2).

The unknowns are one vector x = [theta, psi]: the phase theta_n of each transducer and the phase psi_m of the field at
each control point, which the paper leaves free. With q = A exp(j theta) and u = exp(j psi) the residual is G q -
diag(p) u, paper eq. (5). It counts as 2M real numbers, real parts first.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Progress, Status
from midair.physics import relative_error
from midair.solvers.backend import Backend, Numbers, Rows, squares
from midair.solvers.mirror_symmetry import Lattice

Complex = NDArray[np.complex128]

Start = Literal["previous", "zero"]
"""Initial phases of a frame: those of the previous frame, or zero. The first frame starts at zero."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellTarget:
    """Weights and target pressures of cells or windows in one problem."""

    weights: Array  # w, the share of each point, shape (cell, point)
    wanted: Array  # Target pressure in the unit of amplitude squared, shape (frame, cell)
    faint: float = 0.0  # Frames with an rms target below this report their error relative to this, in the same unit

    def error(self, size: Array) -> Array:
        """|| w |y|^2 - P || / || P || of each frame, from the field's magnitude (frame, point); 0 where P is 0."""
        norm = np.linalg.norm(self.wanted, axis=1)
        norm = np.where(norm > 0, np.maximum(norm, self.faint * np.sqrt(self.wanted.shape[1])), 0.0)
        missed = np.linalg.norm(size**2 @ self.weights.T - self.wanted, axis=1)
        return np.divide(missed, norm, out=np.zeros(len(norm)), where=norm > 0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardField:
    """Transfer matrix and limits of the points that shall be quiet, in one problem."""

    G: NDArray[np.complex128]  # Complex, shape (guard point, transducer), in the unit of the problem's G
    # As in `Guard`, for all points or shape (guard point,); 0 for rows with minimal sound, see `terms.quiet_ears`
    ceiling: float | NDArray[np.float64]
    weight: float  # As in `Guard`

    @property
    def ceilings(self) -> NDArray[np.float64]:
        """Ceiling of each point, shape (guard point,)."""
        return np.array(np.broadcast_to(self.ceiling, len(self.G)), np.float64)

    def times(self, root: Array) -> "GuardField":
        """Multiply the term of each point by a weight, whose `root` (guard point,) goes into field and ceiling."""
        return GuardField(G=root[:, None] * self.G, ceiling=root * self.ceilings, weight=self.weight)

    def and_quiet(self, rows: NDArray[np.complex128], weight: float) -> "GuardField":
        """Add rows whose field shall be minimal, with their own weight."""
        ceiling = np.concatenate([self.ceilings, np.zeros(len(rows))])
        # With a ceiling of 0 the term is a plain square, so the weight can go into the rows.
        G = np.concatenate([self.G, np.sqrt(weight / self.weight) * rows])
        return GuardField(G=G, ceiling=ceiling, weight=self.weight)


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """One transfer matrix and the target amplitudes of all frames."""

    G: Complex
    """Complex field of each transducer at full drive, shape (point, transducer), over the strongest focus
    (`physics.focus_amplitude`), so that tolerances mean the same for any array.
    """
    amplitude: Array
    """p, target magnitude of the field, shape (frame, point), in the same unit as G."""
    level: float = 1.0
    """A, drive of every transducer, 0 to 1."""
    psi: Array | None = None
    """Initial phases of the field in rad, shape (point,); zero if None. See `phases.spreading_phase`."""
    guard: GuardField | None = None
    """Points outside the control grid where the field shall be quiet; see `terms.guard`."""
    cells: CellTarget | None = None
    """Target pressures of sensor cells or windows, which replace the error at the points; see `terms.fit`.
    `amplitude` still decides which frames are silent, and where the solver starts.
    """
    smooth: float = 0.0
    """Weight of phase changes between frames; see `phase_change`."""
    position: Array | None = None
    """Positions of the transducers in m, shape (transducer, 3), for methods that sample them evenly."""
    lattice: Lattice | None = None
    """If given, the columns of G are its places, as if there were a transducer of strength 1 at each; points, and those
    of the guard, are a quarter and then its mirror images.
    """

    def with_quiet(self, rows: Complex, weight: float) -> "Problem":
        """Add rows (row, transducer) whose field shall be minimal, with their weight."""
        none = GuardField(G=np.zeros((0, self.transducers), complex), ceiling=0.0, weight=1.0)
        return replace(self, guard=(self.guard or none).and_quiet(rows, weight))

    @property
    def first_psi(self) -> Array:
        """Initial phases of the field, shape (point,), in rad."""
        return np.zeros(self.points) if self.psi is None else self.psi

    @cached_property
    def gram(self) -> Complex:
        """A^2 G G^H, shape (point, point): the part of J J^T that does not depend on the phases."""
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
    """Phases that a solver found."""

    phase: Array
    """theta in rad, shape (frame, transducer); any multiple of 2 pi may be added."""
    iterations: NDArray[np.int64]
    """Iterations made, shape (frame,)."""
    status: tuple[Status, ...]
    """One status per frame."""
    level: Array | None = None
    """Factor on the problem's level, shape (frame,), from methods that find only the shape of a field; 1 if None."""
    end: "WarmStart | None" = None
    """Start of the next part of a recording; None while all frames are silent."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WarmStart:
    """State from which a solver continues with the next part of a recording."""

    # Phases in rad of the last frame that is not silent, shape (transducer,); silent frames after it keep them
    theta: Array
    known: Any = None  # State private to the method that made it; None if it needs none


class Solver(Protocol):
    """Interface of a solver: frozen settings and `solve`. It never raises for not converging and never returns NaN."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases for each frame of the problem; `after` is the end of the previous part."""
        ...


def status_of(frames: int, audible: NDArray[np.int64]) -> tuple[Status, ...]:
    """Status of frames by a method with a fixed number of iterations: "iterations", or "silent"."""
    sounding = set(audible.tolist())
    return tuple("iterations" if frame in sounding else "silent" for frame in range(frames))


def error_of(problem: Problem, theta: Array, level: Array | None = None) -> Array:
    """Relative error ``E = || |G q| - p || / || p ||`` of each frame, shape (frame,); 0 for silent frames.

    The paper prints an additional factor 1/M, with which its 5 to 15 % would be .02 to .06 %; it is left out here. If
    the problem has `cells`, the error is ``|| w |G q|^2 - P || / || P ||`` of their pressures.

    `theta`, shape (frame, transducer), are the phases in rad; `level`, shape (frame,) or (frame, transducer), is a
    factor on the problem's level, 1 if None.
    """
    if level is None:
        field = np.abs(problem.field(theta))
    elif level.ndim == 2:
        field = np.abs((problem.level * level * np.exp(1j * theta)) @ problem.G.T)
    else:
        field = level[:, None] * np.abs(problem.field(theta))
    return error_of_field(problem, field)


def error_of_field(problem: Problem, field: Array) -> Array:
    """The error of `error_of` from the magnitude of the field at the control points, shape (frame, point)."""
    if problem.cells is not None:
        # A silent frame is played as silence, so the pressures of its cells do not count.
        return problem.cells.error(field) * problem.amplitude.any(axis=1)
    # A silent target is played as silence, whatever its phases are.
    return np.where(problem.amplitude.any(axis=1), relative_error(field, problem.amplitude), 0.0)


def residual(problem: Problem, p: Array, x: Array) -> Complex:
    """G q - diag(p) u of eq. (5), shape (point,), for one target p (point,) and x = [theta, psi]."""
    theta, psi = x[: problem.transducers], x[problem.transducers :]
    return problem.field(theta) - p * np.exp(1j * psi)


def phases_and_errors(
    backend: Backend, problem: Problem, phase: Array, level: Array | None, bits: int | None
) -> tuple[Array, Array]:
    """Phases as they are played, 0 to 2 pi (frame, transducer), and their errors (frame,) as by `error_of`.

    `backend`, the device that solved them, must be in double precision; on the host this takes longer than a GPU needs
    to solve. `phase` is in rad; `level`, (frame,) or (frame, transducer), is a factor on the problem's level; `bits`
    rounds phases to 2 pi / 2^bits as `physics.quantise_phase` does.
    """
    G, played, size = backend.put(problem.level * problem.G.T), np.empty_like(phase), np.empty(problem.amplitude.shape)
    xp, turn, steps = backend.xp, 2 * np.pi, 2.0 ** (bits or 0)
    with backend.at_work():
        for first in range(0, len(phase), backend.rows):
            here = slice(first, first + backend.rows)
            theta = backend.put(phase[here])
            if bits is None:
                theta = xp.remainder(theta, turn)
            else:
                theta = xp.remainder(xp.round(theta / turn * steps), steps) * (turn / steps)
            q = backend.phasor(theta)
            if level is not None:
                q = backend.put(level[here].reshape(theta.shape[0], -1)) * q
            played[here], size[here] = backend.get(theta), backend.get(xp.abs(q @ G))
    return played, error_of_field(problem, size)


def cell_misfit(xp: Any, size: Rows, weights: Rows, wanted: Rows, scale: Numbers) -> tuple[Numbers, Rows]:
    """The cost scale || w |y|^2 - P ||^2 / 2 of each row, and the factor of y in its slope, 2 scale w^T (w |y|^2 - P).

    `size` (row, point) is |y|, `weights` (point, cell) w transposed, `wanted` (row, cell) P, `scale` (row,) 1 / || P
    ||^2. d cost = Re(conj(slope) dy).
    """
    missed = (size * size) @ weights - wanted
    return 0.5 * scale * squares(xp, missed), (2 * scale[:, None] * missed) @ weights.T


def misfit(xp: Any, size: Rows, p: Rows) -> tuple[Numbers, Rows]:
    """|| |y| - p ||^2 / 2 of each row (row,), and the factor of y in its slope, (|y| - p) / |y| (row, point).

    At the best phases u of the target || y - diag(p) u || is || |y| - p ||.
    """
    missed = size - p
    # The direction at an exactly silent point is undefined; 0 is used.
    return 0.5 * squares(xp, missed), missed / (size + xp.finfo(size.dtype).smallest_normal)


def excess(xp: Any, size: Rows, ceiling: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost lambda sum max(|y| - c, 0)^2 / 2 of each row (row,), and the factor of y in its slope.

    `size` is |y| on the ring, of each row any shape, `ceiling` c = kappa times the row's loudest target.
    """
    above = xp.maximum(size - ceiling, 0)
    # The smallest number gives slope 0 instead of 0 / 0 at a silent point.
    cost = 0.5 * weight * squares(xp, xp.reshape(above, (above.shape[0], -1)))
    return cost, weight * above / (size + xp.finfo(size.dtype).smallest_normal)


def excess_rows(
    guard: GuardField, theta: NDArray[np.float64], level: float, peak: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The term as residuals for least squares: sqrt(lambda) (|y| - c) where positive, and their derivative by theta.

    Shapes (active point,) and (active point, transducer); the derivative is -sqrt(lambda) Im(conj(y) A G exp(j theta))
    / |y|.
    """
    q = level * np.exp(1j * theta)
    y = guard.G @ q
    above = np.abs(y) - guard.ceiling * peak
    active = above > 0
    root = np.sqrt(guard.weight)
    turned = (y[active].conj() / np.abs(y[active]))[:, None] * guard.G[active] * q
    return root * above[active], -root * turned.imag


def phase_change(xp: Any, q: Rows, before: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost of phase changes between frames of each row (row,), and the gradient of their sum by the phases.

    A transducer whose phase jumps by d loses amplitude while it follows, down to cos(d / 2); the loss repeats at the
    frame rate and is audible (Suzuki et al., IEEE Trans. Haptics 13 (2020)). The cost is mu mean_n |q_n - q_n'|^2 / 2 =
    mu mean_n (1 - Re(conj(q_n) q_n')) with the previous row q', its gradient mu / N Im(q_n conj(q_n' + q_n'')) with
    both neighbours; the last row has one. q (row, transducer) are drives of magnitude 1 in order of time; `before` (1,
    transducer) is the fixed drive before the first, 0 if there is none; `weight` is mu.
    """
    count = q.shape[1]
    earlier = xp.concat([before, q[:-1, :]], axis=0)
    later = xp.concat([q[1:, :], xp.zeros_like(before)], axis=0)
    kept = xp.real(xp.vecdot(earlier, q))
    return weight * (1 - kept / count), (weight / count) * xp.imag(q * xp.conj(earlier + later))
