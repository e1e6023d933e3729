"""Many frames at once, in three moves that are nothing but matrix products.

1. The field: of all fields that the array could make if its transducers were free in amplitude, the one closest to the
   target. Unknowns are the r coordinates of the field, a seventh of the transducers, so that this is cheap; drives
   louder than full cost extra.
2. The lift: phases whose field is that one. Alternating projections between the drives that make the field and the
   drives that are equally loud, with over-relaxation.
3. The polish: the error itself as a function of the phases alone. At the best psi, || G q - diag(p) u || is
   || |G q| - p ||, so that psi needs no unknowns.

Moves 1 and 3 are L-BFGS on batches. How this was chosen, and what lost: docs/decisions/0004-solvers.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Status
from midair.solve.lbfgs import LBFGS, Function, Numbers, Rows
from midair.solve.modes import Modes, modes
from midair.solve.problem import Answer, Problem, Progress

Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fast:
    """Settings of the batch solver.

    Attributes
    ----------
    iterations : int
        Of the polish.
    more_iterations : int
        That the worst quarter of a batch gets on top.
    field_iterations, lift_iterations : int
        Of the first and the second move.
    tolerance : float
        Modes of G below this part of the largest singular value are left out of the iterations; the error that is
        reported is that of the whole G.
    loudness : float
        Weight of drives above full in the first move.
    floor : float
        Modes below this part of the largest singular value are asked for less in the first field.
    every : int
        One transducer in so many is looked at for loudness: a drive made of r modes is smooth.
    relaxation : float
        Of the projections, 1 to 2.
    batch : int
        Frames at once: large enough for matrix products, small enough for the cache.
    memory : int
        Pairs that L-BFGS keeps.
    faintest : float
        Norm of a target, in units of the focus, below which it counts as this faint: the range of single precision.
    precision : {"single", "double"}
        Of the iterations. Rounding of single precision is a thousandth of the smallest error seen.
    """

    iterations: int = 40
    more_iterations: int = 100
    field_iterations: int = 110
    lift_iterations: int = 10
    tolerance: float = 5e-3
    loudness: float = 0.0075
    floor: float = 0.1
    every: int = 4
    relaxation: float = 1.5
    batch: int = 128
    memory: int = 4
    faintest: float = 1e-12
    precision: Literal["single", "double"] = "single"

    def solve(self, problem: Problem, *, progress: Progress | None = None) -> Answer:
        """Phases for each frame; silent ones keep those of the frame before them.

        The iterations that are reported are those of all three moves, without what the worst quarter gets on top.
        """
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.zeros((len(problem.amplitude), problem.transducers))
        made = np.zeros(len(phase), np.int64)
        if len(audible):
            machine = _Machine.of(problem, self)
            for some in _batches(audible, self.batch):
                phase[some] = machine.phases(problem.amplitude[some])
                made[some] = self.field_iterations + self.lift_iterations + self.iterations
                if progress is not None:
                    progress(int(some[-1]) + 1, len(phase))
        return Answer(phase=hold(phase, audible), iterations=made, status=_status(len(phase), audible))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Machine:
    """The matrices of one problem, in the precision of the iterations, and the three moves."""

    settings: Fast
    field: Complex
    """U diag(s) A, transposed: (mode, point); from V^H q to the field."""
    drive: Complex
    """V transposed: (mode, transducer)."""
    s: NDArray[Any]
    """Singular values times A."""
    psi: NDArray[Any]
    """First phase of the field, exp j psi: (point,)."""

    @classmethod
    def of(cls, problem: Problem, settings: Fast) -> "_Machine":
        kept: Modes = modes(problem.G, tolerance=settings.tolerance)
        exact = np.complex64 if settings.precision == "single" else np.complex128
        s = problem.level * kept.s
        return cls(
            settings=settings,
            field=np.ascontiguousarray((kept.U * s).T, exact),
            drive=np.ascontiguousarray(kept.V.T, exact),
            s=s.astype(np.float32 if settings.precision == "single" else float),
            psi=np.exp(1j * problem.first_psi).astype(exact),
        )

    def phases(self, amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
        """The three moves for targets of shape (row, point): phases (row, transducer), in rad."""
        size = np.maximum(np.linalg.norm(amplitude, axis=1, keepdims=True), self.settings.faintest)
        # Targets of norm 1, and the array louder to match: then cost is E^2 / 2 and single precision is enough.
        p = (amplitude / size).astype(self.s.dtype)
        gain = (1 / size).astype(self.s.dtype)
        theta = np.angle(self._lift(self._field(p, gain)))
        return np.asarray(self._polish(theta, p, gain), np.float64)

    def _field(self, p: Rows, gain: Numbers) -> Complex:
        """Coordinates V^H q of the best field with free amplitudes, (row, mode)."""
        root = np.sqrt(self.s)
        # In z = sqrt(s) a the weak modes are neither stiff nor out of reach; a and s a are both slower.
        out, drive = self.field / root[:, None], self.drive[:, :: self.settings.every] / root[:, None]
        out_back, drive_back = out.conj().T.copy(), drive.conj().T.copy()
        weight = self.settings.loudness / drive.shape[1]

        def function(x: Rows) -> tuple[Numbers, Rows]:
            z = x.view(self.field.dtype)
            cost, slope = _misfit(gain * (z @ out), p)
            q = z @ drive
            above = np.maximum(_square(q) - 1, 0)
            gradient = gain * (slope @ out_back) + weight * ((above * q) @ drive_back)
            return cost + 0.25 * weight * np.einsum("rn,rn->r", above, above), gradient.view(p.dtype)

        # The field p exp(j psi), without asking much of weak modes: z = sqrt(s) a, a = s U^H y / (s^2 + floor^2).
        smooth = root / (self.s**2 + (self.settings.floor * self.s[0]) ** 2)
        first = ((p * self.psi / gain) @ self.field.conj().T * smooth).astype(self.field.dtype)
        step = 1 / (self.s[0] * gain[:, 0] ** 2)
        state = LBFGS(memory=self.settings.memory).run(
            function, first.view(p.dtype), step, self.settings.field_iterations
        )
        return state.x.view(self.field.dtype) / root

    def _lift(self, a: Complex) -> Complex:
        """Drives of magnitude 1 with V^H q close to a, (row, transducer).

        All rows start at the same drive, that of the lens, so that what no point can hear stays alike from frame to
        frame.
        """
        back = self.drive.conj().T.copy()
        lens = (self.psi @ self.field.conj().T / self.s**2) @ self.drive
        q = np.broadcast_to(rippled(lens), (len(a), len(lens)))
        for _ in range(self.settings.lift_iterations):
            q = unit(q + self.settings.relaxation * ((a - q @ back) @ self.drive))
        return q

    def _polish(self, theta: Rows, p: Rows, gain: Numbers) -> Rows:
        """Least || |G q| - p || from theta on, (row, transducer)."""
        function = phase_function(self.field, self.drive, p, gain)
        step = 1 / (self.s[0] * gain[:, 0]) ** 2
        method = LBFGS(memory=self.settings.memory)
        state = method.run(function, theta, step, self.settings.iterations)
        worst = np.argsort(state.cost)[-((len(theta) + 3) // 4) :]
        function = phase_function(self.field, self.drive, p[worst], gain[worst])
        state.x[worst] = method.run(function, state.x[worst], state.scale[worst], self.settings.more_iterations).x
        return state.x


def phase_function(field: Complex, drive: Complex, p: Rows, gain: Numbers) -> Function:
    """Theta -> E^2 / 2 and its gradient, row by row.

    The gradient of || |y| - p ||^2 / 2 by theta_n is Im(conj(q_n) (G^H r)_n) with r = (|y| - p) y / |y|.

    Parameters
    ----------
    field, drive : ndarray of complex, shape (mode, point) and (mode, transducer)
        U diag(s) A and V, transposed.
    p : ndarray, shape (row, point)
        Targets of norm 1.
    gain : ndarray, shape (row, 1)
        One over the norm that the targets had.
    """
    drive_back, field_back = drive.conj().T.copy(), field.conj().T.copy()

    def function(theta: Rows) -> tuple[Numbers, Rows]:
        q = np.empty(theta.shape, drive.dtype)
        np.cos(theta, out=q.real)
        np.sin(theta, out=q.imag)
        cost, slope = _misfit(gain * ((q @ drive_back) @ field), p)
        back = (slope @ field_back) @ drive
        return cost, gain * (q.real * back.imag - q.imag * back.real)

    return function


def unit(q: Complex) -> Complex:
    """Q / |q|; 1 where q is 0."""
    size = np.abs(q)
    return np.where(size > 0, q / np.where(size > 0, size, 1), 1).astype(q.dtype)


def rippled(q: Complex) -> Complex:
    """The phases of q (transducer,) with a ripple of .3 rad: drives all in step with a mode would stay so for ever."""
    return (unit(q) * np.exp(0.3j * np.sin(2.4 * np.arange(len(q))))).astype(q.dtype)


def hold(phase: NDArray[np.float64], audible: NDArray[np.int64]) -> NDArray[np.float64]:
    """Phases of silent frames are those of the last audible frame before them; zero before the first."""
    last = np.full(len(phase), -1)
    last[audible] = audible
    last = np.maximum.accumulate(last)
    return np.where(last[:, None] >= 0, phase[last], 0.0)


def _misfit(y: Complex, p: Rows) -> tuple[Numbers, Complex]:
    """|| |y| - p ||^2 / 2 of each row, and its gradient by y: (|y| - p) y / |y|."""
    size = np.abs(y)
    missed = size - p
    # A point that is exactly silent has no direction; any will do, none is taken.
    y *= missed / np.maximum(size, np.finfo(size.dtype).tiny)
    return 0.5 * np.einsum("rm,rm->r", missed, missed), y


def _square(q: Complex) -> Rows:
    return q.real**2 + q.imag**2


def _batches(audible: NDArray[np.int64], size: int) -> Iterator[NDArray[np.int64]]:
    for first in range(0, len(audible), size):
        yield audible[first : first + size]


def _status(frames: int, audible: NDArray[np.int64]) -> tuple[Status, ...]:
    heard = set(audible.tolist())
    return tuple("iterations" if frame in heard else "silent" for frame in range(frames))
