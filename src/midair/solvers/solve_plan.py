"""The checked settings of a solution, and the solution of one part of a recording."""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, Progress, Setting, Solution, TransducerArray
from midair.physics import ArrayKey, middle_of, palm_matrix, quantise_phase, radiation_pressure
from midair.solvers.backend import backend as backend_of
from midair.solvers.backend import one_blas_thread
from midair.solvers.fast import Fast
from midair.solvers.free import Free
from midair.solvers.glide import Glide, frames_in_block
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.methods import Method, SolverSettings
from midair.solvers.mirror_symmetry import Lattice, mirror_images
from midair.solvers.phases import needed_convergence, spreading_phase
from midair.solvers.problem import CellTarget, GuardField, Problem, WarmStart, error_of, phases_and_errors
from midair.solvers.terms.amplitudes import doubled, with_amplitudes
from midair.solvers.terms.fit import Cells, Windows
from midair.solvers.terms.guard import Guard
from midair.solvers.terms.temperatures import psi_at_temperatures

TOGETHER = 256
"""Approximate number of sounding frames in a part."""


def frames_per_part(solver: Method) -> int:
    """Number of sounding frames in a part: whole batches, or whole blocks.

    A batch cut at the end of a part would have matrix products of another size, and so differ in the last digit.
    """
    if isinstance(solver, Glide):
        return frames_in_block(solver.coarse, solver.block_on()) * solver.jobs
    if isinstance(solver, Free):
        # Few parts, since each computes its matrices again.
        return 4 * solver.block
    if isinstance(solver, Fast):
        return _whole_batches(solver)
    if isinstance(solver, LevenbergMarquardt) and solver.start == "zero" and solver.first == "field":
        return _whole_batches(solver.first_moves)
    return TOGETHER


def fits_at_once(frames: int, solver: Method) -> bool:
    """True for a target of at most two parts: it is solved at once, unless its first part is needed early."""
    return frames <= 2 * frames_per_part(solver)


def _whole_batches(solver: Fast) -> int:
    batch = solver.batch or backend_of(solver.backend).rows
    return batch * max(1, TOGETHER // batch)


def automatic_level(amplitude: Array, *, strength: float = 0.1, lowest: float = 0.05) -> float:
    """Level at which the loudest target, in units of the focus, has this strength; between `lowest` and 1.

    If the strength is small, the array's power goes to places outside the target; if it is large, the target cannot be
    reached: E hardly grows up to strength .1, and fast above. Below `lowest` an 8-bit intensity has hardly a dozen
    steps.
    """
    return float(np.clip(amplitude.max() / strength, lowest, 1.0))


def _matrix(points: Array, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> NDArray[np.complex128]:
    """Transfer matrix with the echo of a palm in the middle of the grid, as far as the array's reflection is known.

    Read-only if it has at most 16 MB: the last few are kept, since each part and the next recording have the same.
    """
    key = (points.tobytes(), ArrayKey(array), array.reflection, tuple(middle_of(grid).tolist()), acoustics)
    return _kept_matrix(*key) if 16 * len(points) * array.count <= 2**24 else _kept_matrix.__wrapped__(*key)


@lru_cache(maxsize=8)
def _kept_matrix(
    points: bytes, key: ArrayKey, reflection: complex, middle: tuple[float, ...], acoustics: Acoustics
) -> NDArray[np.complex128]:
    places = np.frombuffer(points).reshape(-1, 3)
    made = palm_matrix(places, key.array, reflection=reflection, middle=np.array(middle), acoustics=acoustics)
    made.flags.writeable = False
    return made


_NEAR = 1e-3
"""Largest distance in m, along x or y, between the middles of a control grid and of an array that is folded."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MirroredPoints:
    """Samples of the field, and points of a guard, about the middle of a lattice: a quarter, then its mirror images."""

    grid: ControlGrid  # The samples in the order of a grid
    order: NDArray[np.intp]  # Their indices, image after image
    ring: NDArray[np.float64]  # Points of the guard, shape (point, 3), in m, those on a mirror several times
    root: NDArray[np.float64]  # Square root of the weight of each

    @classmethod
    def of(cls, grid: ControlGrid, middle: tuple[float, float], guard: Guard | None) -> "MirroredPoints | None":
        """The points for a grid; None if its middle is elsewhere, or if a sample is on a mirror."""
        if np.abs(np.subtract(middle, grid.centre)).max() > _NEAR:
            return None
        samples, ring = replace(grid, centre=middle), np.zeros((0, 3)) if guard is None else guard.points(grid, middle)
        own, around = mirror_images(samples.position, middle), mirror_images(ring, middle)
        if own is None or around is None or own[1].min() < 1:
            return None
        root = np.tile(np.sqrt(around[1]), 4)
        return cls(grid=samples, order=own[0].ravel(), ring=ring[around[0].ravel()], root=root)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalisedSetup:
    """Target and transfer matrices in units of the strongest focus, in which tolerances and weights suit any array."""

    target: AmplitudeFrames
    array: TransducerArray
    airs: tuple[Acoustics, ...]
    G: list[NDArray[np.complex128]]  # One matrix for each air, the nominal air first
    focus: float  # The strongest focus in the nominal air
    lattice: Lattice | None = None  # That of a symmetric array, whose places then are `array`
    mirrored: MirroredPoints | None = None  # The points on a lattice, in place of those of the target and the guard

    @classmethod
    def of(cls, target: AmplitudeFrames, array: TransducerArray, airs: tuple[Acoustics, ...]) -> "NormalisedSetup":
        """Compute the matrix for each air, divided by the strongest focus in the first."""
        G = [_matrix(target.grid.position, target.grid, array, each) for each in airs]
        focus = float(np.abs(G[0]).sum(axis=1).max())
        return cls(target=target, array=array, airs=airs, G=[each / focus for each in G], focus=focus)

    def folded(self, ring: Guard | None) -> "NormalisedSetup":
        """The same setup on the places of the array's lattice and points about its middle, if it has one nearby."""
        lattice = Lattice.of(self.array)
        mirrored = None if lattice is None else MirroredPoints.of(self.target.grid, lattice.middle, ring)
        if lattice is None or mirrored is None:
            return self
        grid, places = mirrored.grid, mirrored.grid.position[mirrored.order]
        G = [_matrix(places, grid, lattice.array, each) / self.focus for each in self.airs]
        return replace(self, array=lattice.array, G=G, lattice=lattice, mirrored=mirrored)

    @property
    def _samples(self) -> tuple[ControlGrid, Any]:
        """The grid where the field is computed, and the order of its points."""
        known = self.mirrored
        return (self.target.grid, slice(None)) if known is None else (known.grid, known.order)

    def problem(self, level: float, settings: SolverSettings | None = None, convergence: float = 1.0) -> Problem:
        """The problem for a solver: the target in all airs, and the terms of the settings, none if None.

        With bounded amplitudes it has twice as many transducers, see `terms.amplitudes`.
        """
        times, (grid, order) = len(self.airs), self._samples
        amplitude = (self.target.amplitude / self.focus)[:, order]
        psi = convergence * spreading_phase(grid, self.array, self.airs[0].medium)[order]
        problem = Problem(
            G=self.G[0] if times == 1 else np.concatenate(self.G),
            amplitude=np.tile(amplitude, (1, times)),
            level=level,
            psi=psi_at_temperatures(self.G, psi),
            position=self.array.position,
            lattice=self.lattice,
        )
        if settings is None:
            return problem
        if ring := settings.ring:
            points = ring.points(grid) if self.mirrored is None else self.mirrored.ring
            G = np.concatenate([_matrix(points, grid, self.array, each) for each in self.airs])
            guard = GuardField(G=G / self.focus, ceiling=ring.ceiling, weight=ring.weight)
            problem = replace(problem, guard=guard if self.mirrored is None else guard.times(self.mirrored.root))
        problem = replace(problem, cells=self.cells(settings.means))
        for term in settings.quiet:
            rows = np.concatenate([term.rows(grid, self.array, each) for each in self.airs])
            # The error is a sum over M control points, so a mean over other places is multiplied by M.
            problem = problem.with_quiet(np.sqrt(len(self.G[0])) / self.focus * rows, term.weight)
        problem = replace(problem, smooth=settings.smooth)
        return doubled(problem) if settings.amplitudes == "bounded" else problem

    def cells(self, means: Windows | Cells | None) -> CellTarget | None:
        """Weights and target pressures of windows or cells, if there are any."""
        if means is None:
            return None
        unit = float(radiation_pressure(np.array(self.focus), self.airs[0].medium))
        target, (grid, order) = self.target, self._samples
        made = means.target(target.amplitude / self.focus, target.grid, unit, grid)
        return replace(made, weights=made.weights[:, order])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvePlan:
    """Checked settings for solving a recording, as a whole or part by part."""

    settings: SolverSettings
    solver: Method
    own: NormalisedSetup
    scene: NormalisedSetup
    level: float
    convergence: float
    bits: int | None

    @classmethod
    def of(
        cls,
        target: AmplitudeFrames,
        array: TransducerArray,
        settings: SolverSettings | None = None,
        *,
        acoustics: Acoustics | None = None,
        bits: int | None = None,
        **changes: Any,
    ) -> "SolvePlan":
        """Check the settings of `solve`."""
        settings = (settings or SolverSettings()).but(**changes)
        solver, acoustics = settings.solver(), acoustics or Acoustics()
        if bits is not None and not 1 <= bits <= 16:
            raise InputError(f"bits: expected 1 to 16 bits per phase, or None, got {bits}")
        settings.check()
        airs = settings.airs(acoustics)
        own = scene = NormalisedSetup.of(target, array, (acoustics,))
        level = settings.level
        if level == "auto":
            level = automatic_level(np.array(target.amplitude.max() / own.focus))
        if len(airs) > 1:
            scene = NormalisedSetup.of(target, array, airs)
        elif folds(settings):
            scene = own.folded(settings.ring)
        convergence = settings.convergence
        if convergence == "auto":
            convergence = needed_convergence(target.amplitude.max() / level, target.grid, array, acoustics.medium)
        solved = {"level": level, "convergence": convergence}
        return cls(settings=settings, solver=solver, own=own, scene=scene, **solved, bits=bits)

    @property
    def leads(self) -> bool:
        """Whether a part begins with the last frame of the part before it."""
        return isinstance(self.solver, Glide)

    def joint(self, amplitude: Array, *, first: bool) -> int:
        """Number of next frames that form a part; 0 while there are too few."""
        sounding = np.flatnonzero(amplitude.any(axis=1))
        wanted = frames_per_part(self.solver)
        if first and isinstance(self.solver, Glide):
            # The short first block also contains the first mark.
            wanted = min(self.solver.opening, frames_in_block(self.solver.coarse, self.solver.block_on())) + 1
        return int(sounding[wanted - 1]) + 1 if len(sounding) >= wanted else 0

    def solve(
        self, target: AmplitudeFrames, after: WarmStart | None, progress: Progress | None
    ) -> tuple[Solution, WarmStart | None]:
        """Solve a part from the end of the part before it; returns the solution and its own end."""
        problem = replace(self.scene, target=target).problem(self.level, self.settings, self.convergence)
        # Mean pressures are never asked for in several airs, see `SolvePlan.of`.
        reported = replace(self.own, target=target)
        own = replace(reported.problem(self.level), cells=reported.cells(self.settings.means))
        with one_blas_thread():
            answer = self.solver.solve(problem, after=after, progress=progress)
            if self.settings.amplitudes == "bounded":
                answer = with_amplitudes(answer)
            if self.scene.lattice is not None:
                answer = replace(answer, phase=self.scene.lattice.phase(answer.phase))
            # The error is computed after rounding, so that it is the error of the phases that are played.
            phase, error = self._played(own, answer.phase, answer.level)
        audible = np.array([status != "silent" for status in answer.status], float)
        # Transposed twice, so that (frame,) and (frame, transducer) are both multiplied frame by frame.
        played = self.level * (audible if answer.level is None else (audible * answer.level.T).T)
        drive = Drive(
            phase=phase,
            level=played,
            rate=target.rate,
            array=self.own.array,
            acoustics=self.own.airs[0],
            provenance=target.provenance.then("solve", self._noted()),
        )
        return Solution(drive=drive, error=error, iterations=answer.iterations, status=answer.status), answer.end

    def _played(self, own: Problem, turned: Array, part: Array | None) -> tuple[Array, Array]:
        """Phases as they are played, and their errors, computed on the solver's device."""
        name = getattr(self.solver, "backend", "numpy")
        # Metal has no double precision.
        if name == "numpy" or name.startswith("torch:mps"):
            phase = np.mod(turned, 2 * np.pi) if self.bits is None else quantise_phase(turned, bits=self.bits)
            if isinstance(self.solver, Fast | Glide) and self.solver.precision == "single":
                # A quarter of the time; E differs by less than 1e-6, or 1e-4 of it.
                return phase, phases_and_errors(backend_of("numpy"), own, phase, part, None)[1]
            return phase, error_of(own, phase, part)
        return phases_and_errors(backend_of(name, precision="double"), own, turned, part, self.bits)

    def _noted(self) -> dict[str, Setting]:
        """All settings for the provenance; `jobs` does not change the result."""
        acoustics, solver = self.own.airs[0], self.solver
        return {
            "method": self.settings.name,
            "level": self.level,
            **self.settings.noted(),
            "convergence": self.convergence,
            "bits": self.bits,
            "directivity": acoustics.directivity,
            "speed_m_s": acoustics.medium.speed,
            "temperature_c": acoustics.medium.temperature,
            "humidity": acoustics.medium.humidity,
            "array": self.own.array.name,
            **({"array_calibration": known} if (known := self.own.array.calibration_id) else {}),
            **{field.name: getattr(solver, field.name) for field in fields(solver) if field.name != "jobs"},
        }


def folds(settings: SolverSettings) -> bool:
    """Whether an array with mirror symmetry is folded: for windows or cells, with or without a guard, on NumPy.

    At points alone ADMM cannot handle fields of different kinds that overlap, see docs/decisions/0048-folding.md.
    """
    solver, terms = settings.solver(), settings.asked - {"guard"}
    return isinstance(solver, Glide) and solver.backend == "numpy" and terms == frozenset(["cells"])
