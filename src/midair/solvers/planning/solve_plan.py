"""The checked settings of a solution, and the solution of one part of a recording."""

from dataclasses import dataclass, fields, replace
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, Drive, Progress, Setting, Solution, TransducerArray
from midair.physics import quantise_phase
from midair.solvers.amplitudes import Amplitudes, doubled, halves
from midair.solvers.backend import backend as backend_of
from midair.solvers.device import phases_and_errors
from midair.solvers.exact import Exact
from midair.solvers.fast import Fast
from midair.solvers.glide import Glide
from midair.solvers.methods import Method, check_terms, name_of, terms_of
from midair.solvers.methods import solver as solver_of
from midair.solvers.planning.normalised_setup import NormalisedSetup
from midair.solvers.problem import Answer, Problem, Start, WarmStart, error_of
from midair.solvers.terms import (
    Cells,
    Fit,
    Guard,
    QuietEars,
    QuietPalm,
    Windows,
    airs_around,
    automatic_level,
    name_of_pressure_means,
    pressure_means,
)
from midair.solvers.threads import one_blas_thread

Array = NDArray[np.float64]

TOGETHER = 256
"""Approximate number of sounding frames in a part."""


def frames_per_part(solver: Method) -> int:
    """Number of sounding frames in a part: whole batches, or whole blocks.

    A batch cut at the end of a part would have matrix products of another size, and so differ in the last digit.
    """
    if isinstance(solver, Glide):
        return solver.coarse * max(-(-solver.block_on() // solver.coarse), 1) * solver.jobs
    if isinstance(solver, Fast):
        return _whole_batches(solver)
    if isinstance(solver, Exact) and solver.start == "zero" and solver.first == "field":
        return _whole_batches(solver.first_moves)
    return TOGETHER


def _whole_batches(solver: Fast) -> int:
    batch = solver.batch or backend_of(solver.backend).rows
    return batch * max(1, TOGETHER // batch)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvePlan:
    """Checked settings for solving a recording, as a whole or part by part."""

    method: str
    solver: Method
    own: "NormalisedSetup"
    scene: "NormalisedSetup"
    level: float
    amplitudes: Amplitudes
    ring: Guard | None
    means: Windows | Cells | None
    smooth: float
    robust: float
    quiet_ears: float
    quiet_palm: QuietPalm | None
    bits: int | None

    @classmethod
    def of(
        cls,
        target: AmplitudeFrames,
        array: TransducerArray,
        *,
        method: str | Method = "lm",
        acoustics: Acoustics | None = None,
        iterations: int | tuple[int, int] | None = None,
        start: Start | None = None,
        level: float | Literal["auto"] = 1.0,
        amplitudes: Amplitudes = "equal",
        guard: float | Guard | None = None,
        fit: Fit = "points",
        smooth: float = 0.0,
        robust: float = 0.0,
        quiet_ears: float = 0.0,
        quiet_palm: float | QuietPalm = 0.0,
        bits: int | None = None,
        backend: str | None = None,
        jobs: int | None = None,
        loudest: float | None = None,
    ) -> "SolvePlan":
        """Check the settings of `solve`; `loudest` is the highest amplitude in Pa of the whole recording."""
        solver = solver_of(method, iterations=iterations, start=start, backend=backend, jobs=jobs)
        _check(level, bits, amplitudes, smooth, robust, quiet_ears)
        palm = _palm(quiet_palm)
        acoustics = acoustics or Acoustics()
        airs = airs_around(acoustics, robust)
        ring = Guard(margin=guard) if isinstance(guard, int | float) else guard
        own = NormalisedSetup.of(target, array, (acoustics,))
        if level == "auto":
            peak = target.amplitude.max() if loudest is None else loudest
            level = automatic_level(np.array(peak / own.focus))
        means = pressure_means(fit)
        order = cls(
            method=name_of(method),
            solver=solver,
            own=own,
            scene=own if len(airs) == 1 else NormalisedSetup.of(target, array, airs),
            level=level,
            amplitudes=amplitudes,
            ring=ring,
            means=means,
            smooth=smooth,
            robust=robust,
            quiet_ears=quiet_ears,
            quiet_palm=palm,
            bits=bits,
        )
        asked = terms_of(
            amplitudes=amplitudes,
            guard=guard,
            fit=fit,
            smooth=smooth,
            robust=robust,
            quiet_ears=quiet_ears,
            quiet_palm=quiet_palm,
        )
        check_terms(method, asked)
        return order

    @property
    def leads(self) -> bool:
        """Whether a part begins with the last frame of the part before it."""
        return isinstance(self.solver, Glide)

    def joint(self, amplitude: Array, *, first: bool) -> int:
        """Number of next frames that form a part; 0 while there are too few."""
        sounding = np.flatnonzero(amplitude.any(axis=1))
        # With bisection, the first part also contains the first mark.
        wanted = frames_per_part(self.solver) + (self.leads and first)
        return int(sounding[wanted - 1]) + 1 if len(sounding) >= wanted else 0

    def end_of(self, marks: AmplitudeFrames) -> WarmStart:
        """Warm start after a block with these marks, for method "glide"."""
        problem = self._problem(self.scene, marks)
        with one_blas_thread():
            return cast("Glide", self.solver).end_of(doubled(problem) if self.amplitudes == "bounded" else problem)

    def _problem(self, scene: "NormalisedSetup", target: AmplitudeFrames) -> Problem:
        ears = QuietEars(weight=self.quiet_ears) if self.quiet_ears > 0 else None
        scene = replace(scene, target=target)
        return scene.problem(self.level, self.ring, self.means, self.smooth, ears, self.quiet_palm)

    def solve(
        self, target: AmplitudeFrames, after: WarmStart | None, progress: Progress | None
    ) -> tuple[Solution, WarmStart | None]:
        """Solve a part from the end of the part before it; returns the solution and its own end."""
        own = self._problem(self.own, target)
        problem = own if self.scene is self.own else self._problem(self.scene, target)
        with one_blas_thread():
            asked = doubled(problem) if self.amplitudes == "bounded" else problem
            answer = self.solver.solve(asked, after=after, progress=progress)
            end, part = answer.end, answer.level
            if self.amplitudes == "bounded":
                answer, part = _bounded(answer)
            # The error is computed after rounding, so that it is the error of the phases that are played.
            phase, error = self._played(own, answer.phase, part)
        audible = np.array([status != "silent" for status in answer.status], float)
        # Transposed twice, so that (frame,) and (frame, transducer) are both multiplied frame by frame.
        played = self.level * (audible if part is None else (audible * part.T).T)
        drive = Drive(
            phase=phase,
            level=played,
            rate=target.rate,
            array=self.own.array,
            acoustics=self.own.airs[0],
            provenance=target.provenance.then("solve", self._settings()),
        )
        return Solution(drive=drive, error=error, iterations=answer.iterations, status=answer.status), end

    def _played(self, own: Problem, turned: Array, part: Array | None) -> tuple[Array, Array]:
        """Phases as they are played, and their errors, computed on the solver's device."""
        name = getattr(self.solver, "backend", "numpy")
        # Metal has no double precision.
        if name == "numpy" or name.startswith("torch:mps"):
            phase = np.mod(turned, 2 * np.pi) if self.bits is None else quantise_phase(turned, bits=self.bits)
            return phase, error_of(own, phase, part)
        return phases_and_errors(backend_of(name, precision="double"), own, turned, part, self.bits)

    def _settings(self) -> dict[str, Setting]:
        acoustics = self.own.airs[0]
        settings: dict[str, Setting] = {
            "method": self.method,
            "level": self.level,
            "amplitudes": self.amplitudes,
            "fit": name_of_pressure_means(self.means),
            "smooth": self.smooth,
            "robust_c": self.robust,
            "quiet_ears": self.quiet_ears,
            "quiet_palm": 0.0 if self.quiet_palm is None else self.quiet_palm.weight,
            "bits": self.bits,
            "directivity": acoustics.directivity,
            "speed_m_s": acoustics.medium.speed,
            "temperature_c": acoustics.medium.temperature,
            "humidity": acoustics.medium.humidity,
        }
        if self.quiet_palm is not None and self.quiet_palm.outline:
            settings["quiet_palm_outline"] = self.quiet_palm.outline
        if self.ring is not None:
            settings |= {f"guard_{name}": value for name, value in _settings(self.ring).items()}
        return settings | {"array": self.own.array.name} | _settings(self.solver)


def _check(level: object, bits: int | None, amplitudes: str, smooth: float, robust: float, quiet_ears: float) -> None:
    if level != "auto" and not (isinstance(level, int | float) and 0 < level <= 1):
        shown = f"{level:g}" if isinstance(level, int | float) else repr(level)
        raise InputError(f"level: expected above 0 and at most 1 of full drive, or auto, got {shown}")
    if bits is not None and not 1 <= bits <= 16:
        raise InputError(f"bits: expected 1 to 16 bits per phase, or None, got {bits}")
    if amplitudes not in get_args(Amplitudes):
        raise InputError(f"amplitudes: expected {' or '.join(get_args(Amplitudes))}, got {amplitudes!r}")
    if not 0 <= smooth < np.inf:
        raise InputError(f"smooth: expected 0 or more, got {smooth:g}")
    if not 0 <= robust <= 10:
        raise InputError(f"robust: expected 0 to 10 degrees Celsius, got {robust:g}")
    if not 0 <= quiet_ears < np.inf:
        raise InputError(f"quiet_ears: expected 0 or more, got {quiet_ears:g}")


def _palm(asked: float | QuietPalm) -> QuietPalm | None:
    if isinstance(asked, QuietPalm):
        return asked
    if not 0 <= asked < np.inf:
        raise InputError(f"quiet_palm: expected 0 or more, got {asked:g}")
    return QuietPalm(weight=asked) if asked > 0 else None


def _bounded(answer: Answer) -> tuple[Answer, Array]:
    """The answer of the doubled problem as phases of the array, and the amplitude of each transducer."""
    phase, part = halves(answer.phase)
    if answer.level is not None:
        part = answer.level[:, None] * part
    return Answer(phase=phase, iterations=answer.iterations, status=answer.status), part


def _settings(chosen: Method | Guard) -> dict[str, Setting]:
    """Fields of a solver or a term for the provenance, without `jobs`, which does not change the result."""
    return {field.name: getattr(chosen, field.name) for field in fields(chosen) if field.name != "jobs"}
