"""From the sound amplitude that is wanted to the drive that makes it: the stage of the pipeline."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import chain
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, Drive, Progress, Setting, Solution, TransducerArray
from midair.physics import quantise_phase, radiation_pressure, transfer_matrix
from midair.reel import blocks, taken
from midair.solvers.amplitudes import Amplitudes, doubled, halves
from midair.solvers.backend import backend as backend_of
from midair.solvers.device import settled
from midair.solvers.fast import Fast
from midair.solvers.glide import Glide
from midair.solvers.large import memory_needed
from midair.solvers.lens import spreading_phase
from midair.solvers.methods import Method, check_terms, name_of
from midair.solvers.methods import solver as solver_of
from midair.solvers.problem import Answer, End, Problem, Start, Term, error_of
from midair.solvers.terms import (
    Cells,
    Fit,
    Guard,
    GuardField,
    QuietEars,
    QuietPalm,
    Windows,
    airs_around,
    automatic_level,
    means_of,
    name_of_means,
    psi_in_each,
)
from midair.solvers.threads import one_blas_thread

Array = NDArray[np.float64]


def solve(
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
    progress: Progress | None = None,
) -> Solution:
    """Phases of all transducers, equally loud, whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Peak sound pressure wanted at each control point, in Pa.
    array : TransducerArray
        What is to make it.
    method : str or a solver
        A name in `methods.METHODS`, or a configured solver of `midair.solvers` such as ``Exact(tolerance=1e-3)``.
        "lm": the paper's Levenberg-Marquardt. "exact": the same in the modes of G above .5 % of the strongest,
        cheaper. "fast": many frames at once, each on its own. "glide": a recording as a whole, by bisection in time.
        "live": within a millisecond a frame. "naive", "gs", "wgs", "gs-pat", "greedy": published methods to compare
        with.
    acoustics : Acoustics, optional
        The air and the directivity of a transducer; the paper's if None. The drive carries it.
    iterations : int or tuple of int, optional
        Largest number, for every frame or for frames that start at zero and those that start at the previous frame.
        The method's own (lm: 50 and 20) if None.
    start : {"previous", "zero"}, optional
        Start of every frame after the first; "zero" makes the frames independent. Only "lm" and "exact" have the
        choice; the solver's own, "previous" unless configured, if None.
    level : float or "auto"
        Drive of every transducer, above 0 to 1. "auto": as much as the loudest target needs, see
        `terms.level.automatic_level`. Frames with nothing to play get 0.
    amplitudes : {"equal", "bounded"}
        All transducers at `level`, as in the paper; or each at its own, between 0 and `level`, and the drive's level
        is then (frame, transducer).
    guard : float or Guard, optional
        Keeps a ring around the control points quiet: its width in m, or the term with all its settings.
    fit : {"points", "windows", "cells"}, Windows or Cells
        What is to be met: the target at the control points; what windows of the size of a cell read of it all over the
        square; or what the cells of a sensor read of it, for that one place of the sensor alone. The error is that of
        what was to be met.
    smooth : float
        Weight of the change of phase from frame to frame, see `terms.smooth`: E^2 / 2 plus this times
        mean(1 - cos(change)) is made small. 0 for none; .01 is much.
    robust : float
        Degrees Celsius, 0 to 10, by which the air may be colder or warmer than that of `acoustics`: the root mean
        square of E over that range is made small, see `terms.temperatures`. The error that is told is that of
        `acoustics`; `evaluate.error_in_air` tells the others. 0 for that air alone.
    quiet_ears : float
        Weight of the sound at the ears of a person in front of the array, see `terms.quiet_ears`: 3 is some, 30 much.
        0 for none.
    quiet_palm : float or QuietPalm
        Weight of the sound on a palm around the control points, see `terms.quiet_palm`, or the term with all its
        settings: .1 is much. 0 for none.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
        Not rounded if None. Amplitudes are not rounded.
    backend : str, optional
        What does the arithmetic of "fast" and "glide": "numpy", "torch", "torch:cuda", "cupy"; see `backend.backend`.
    jobs : int, optional
        Blocks that "glide" solves at once, which changes nothing but the time; 1 if None. The other methods have none.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is out of range or unknown, or the method does not take a term (`methods.TAKES`).
    MissingExtraError
        If a backend, or Numba for "live", is not installed.
    """
    order = _Order.of(
        target,
        array,
        method=method,
        acoustics=acoustics,
        iterations=iterations,
        start=start,
        level=level,
        amplitudes=amplitudes,
        guard=guard,
        fit=fit,
        smooth=smooth,
        robust=robust,
        quiet_ears=quiet_ears,
        quiet_palm=quiet_palm,
        bits=bits,
        backend=backend,
        jobs=jobs,
    )
    return order.solve(target, None, progress)[0]


def memory_of(
    target: AmplitudeFrames,
    array: TransducerArray,
    *,
    method: str | Method = "lm",
    acoustics: Acoustics | None = None,
    amplitudes: Amplitudes = "equal",
    guard: float | Guard | None = None,
    robust: float = 0.0,
    backend: str | None = None,
    jobs: int | None = None,
    parts: bool = False,
    **_: Any,
) -> int:
    """Bytes that `solve` with these settings, or `solve_parts`, takes at most at once; see `large.memory_needed`.

    Parameters
    ----------
    target, array, method, acoustics, amplitudes, guard, robust, backend, jobs
        As in `solve`; its other settings do not count.
    parts : bool
        Whether no more than a part is in memory.
    """
    ring = Guard(margin=guard) if isinstance(guard, int | float) else guard
    whole = _together(solver_of(method, backend=backend, jobs=jobs)) if parts else target.frames
    return memory_needed(
        target.grid.count,
        array.count * (2 if amplitudes == "bounded" else 1),
        min(target.frames, whole),
        method=name_of(method),
        guard=0 if ring is None else len(ring.ring(target.grid)),
        airs=len(airs_around(acoustics or Acoustics(), robust)),
    )


def solve_parts(
    target: AmplitudeFrames, array: TransducerArray, *, progress: Progress | None = None, **settings: Any
) -> Iterator[Solution]:
    """The solution of `solve`, part by part: what is in memory does not grow with the recording.

    Each part goes on from where the one before it ended, at a joint where the method would have ended a batch or a
    block of frames anyway: all parts together are what `solve` gives, to rounding.

    Parameters
    ----------
    target : AmplitudeFrames
        Its amplitude may be a reel, which is read once, and once more for the level "auto".
    array : TransducerArray
        What is to make it.
    progress : callable, optional
        Called with (frames done, frames in all).
    **settings
        As in `solve`.

    Yields
    ------
    Solution
        Of the next frames.

    Raises
    ------
    InputError, MissingExtraError
        As in `solve`.
    """
    return _parts(_Order.of(target, array, **settings), target, progress)


def solve_piece(
    target: AmplitudeFrames, array: TransducerArray, *, marks: Array, loudest: float, **settings: Any
) -> Iterator[Solution]:
    """The solution of one of the `pieces` of a recording, part by part, without the frames before it.

    Phases are those of the whole recording, to the last bit.

    Parameters
    ----------
    target : AmplitudeFrames
        Of the frames of the piece.
    array : TransducerArray
        What is to make it.
    marks : ndarray, shape (mark, point)
        Amplitude of the piece's marks, in Pa; none for the first piece.
    loudest : float
        Highest amplitude of the whole recording, in Pa, by which the level "auto" goes.
    **settings
        As in `solve`, with method "glide".

    Yields
    ------
    Solution
        Of the next frames, block by block.

    Raises
    ------
    InputError
        As in `solve`, or if the method is another.
    """
    order = _Order.of(target, array, loudest=loudest, **settings)
    if not order.leads:
        raise InputError(f"method: expected glide, whose recordings come in pieces, got {order.method}")
    after = order.end_of(replace(target, amplitude=marks)) if len(marks) else None
    return _parts(order, target, None, after, marks[-1:])


def _parts(
    order: "_Order",
    target: AmplitudeFrames,
    progress: Progress | None,
    after: End | None = None,
    lead: Array | None = None,
) -> Iterator[Solution]:
    none = np.zeros((0, target.grid.count))
    lead, rest, done = none if lead is None else lead, none, 0
    for block in chain(blocks(target.amplitude, _READ), [None]):
        rest = rest if block is None else np.concatenate([rest, block])
        while cut := order.joint(rest, first=after is None) or (len(rest) if block is None else 0):
            known = len(lead)
            part = replace(target, amplitude=np.concatenate([lead, rest[:cut]]))
            told = None if progress is None else _beyond(progress, done - known, target.frames)
            solution, after = order.solve(part, after, told)
            yield _without(solution, known)
            sounding = np.flatnonzero(rest[:cut].any(axis=1))
            if order.leads and len(sounding):
                lead = rest[sounding[-1:]]
            rest, done = rest[cut:], done + cut


def read_as_solved(amplitude: Array, first: int, last: int) -> Array:
    """Frames of a target, a reel or an array, in the very blocks in which `solve_parts` reads it.

    A reel works out what it reads, and products of more or fewer frames at once end in another digit.
    """
    begin = first // _READ * _READ
    read = [taken(amplitude, at, min(at + _READ, len(amplitude))) for at in range(begin, last, _READ)]
    return np.concatenate(read)[first - begin : last - begin]


def _beyond(progress: Progress, before: int, frames: int) -> Progress:
    return lambda done, _: progress(before + done, frames)


def _without(solution: Solution, known: int) -> Solution:
    """A solution less its first frames."""
    if not known:
        return solution
    drive = replace(solution.drive, phase=solution.drive.phase[known:], level=solution.drive.level[known:])
    return Solution(
        drive=drive,
        error=solution.error[known:],
        iterations=solution.iterations[known:],
        status=solution.status[known:],
    )


_READ = 256
"""Frames of a target that are read at once."""

_TOGETHER = 256
"""Frames that sound in a part, about."""


def _together(solver: Method) -> int:
    """How many frames that sound a part has: whole batches, or whole blocks."""
    if isinstance(solver, Glide):
        return solver.coarse * max(-(-solver.block_on() // solver.coarse), 1) * solver.jobs
    if isinstance(solver, Fast):
        whole = solver.batch or backend_of(solver.backend).rows
        return whole * max(1, _TOGETHER // whole)
    return _TOGETHER


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Order:
    """How a recording is to be solved, whole or part by part."""

    method: str
    solver: Method
    own: "_Scene"
    scene: "_Scene"
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
    ) -> "_Order":
        solver = solver_of(method, iterations=iterations, start=start, backend=backend, jobs=jobs)
        _check(level, bits, amplitudes, smooth, robust, quiet_ears)
        palm = _palm(quiet_palm)
        acoustics = acoustics or Acoustics()
        airs = airs_around(acoustics, robust)
        ring = Guard(margin=guard) if isinstance(guard, int | float) else guard
        own = _Scene.of(target, array, (acoustics,))
        if level == "auto":
            peak = target.amplitude.max() if loudest is None else loudest
            level = automatic_level(np.array(peak / own.focus))
        means = means_of(fit)
        order = cls(
            method=name_of(method),
            solver=solver,
            own=own,
            scene=own if len(airs) == 1 else _Scene.of(target, array, airs),
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
        asked: set[Term] = {"amplitudes"} if amplitudes == "bounded" else set()
        asked |= {"robust"} if robust > 0 else set()
        asked |= {"quiet-ears"} if quiet_ears > 0 else set()
        asked |= {"quiet-palm"} if palm is not None else set()
        terms: dict[Term, bool] = {"guard": ring is not None, "cells": means is not None, "smooth": smooth > 0}
        asked |= {term for term, there in terms.items() if there}
        check_terms(method, asked)
        return order

    @property
    def leads(self) -> bool:
        """Whether a part begins with the last frame of the one before it."""
        return isinstance(self.solver, Glide)

    def joint(self, amplitude: Array, *, first: bool) -> int:
        """How many of the next frames are a part that ends where the method can go on; 0 while there are too few."""
        sounding = np.flatnonzero(amplitude.any(axis=1))
        # The first part of a recording by bisection has the first mark besides.
        wanted = _together(self.solver) + (self.leads and first)
        return int(sounding[wanted - 1]) + 1 if len(sounding) >= wanted else 0

    def end_of(self, marks: AmplitudeFrames) -> End:
        """What frames go on from after a block with these marks, by the method that has blocks."""
        problem = self._problem(self.scene, marks)
        with one_blas_thread():
            return cast("Glide", self.solver).end_of(doubled(problem) if self.amplitudes == "bounded" else problem)

    def _problem(self, scene: "_Scene", target: AmplitudeFrames) -> Problem:
        ears = QuietEars(weight=self.quiet_ears) if self.quiet_ears > 0 else None
        scene = replace(scene, target=target)
        return scene.problem(self.level, self.ring, self.means, self.smooth, ears, self.quiet_palm)

    def solve(
        self, target: AmplitudeFrames, after: End | None, progress: Progress | None
    ) -> tuple[Solution, End | None]:
        """A part, from where the one before it ended, and where it ends."""
        own = self._problem(self.own, target)
        problem = own if self.scene is self.own else self._problem(self.scene, target)
        with one_blas_thread():
            asked = doubled(problem) if self.amplitudes == "bounded" else problem
            answer = self.solver.solve(asked, after=after, progress=progress)
            end, part = answer.end, answer.level
            if self.amplitudes == "bounded":
                answer, part = _bounded(answer)
            # Rounded before the error is taken, so that it is the error of what will be played.
            phase, error = self._told(own, answer.phase, part)
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

    def _told(self, own: Problem, turned: Array, part: Array | None) -> tuple[Array, Array]:
        """Phases as they will be played, and their errors, worked out where the phases were."""
        name = getattr(self.solver, "backend", "numpy")
        # Metal has no double precision.
        if name == "numpy" or name.startswith("torch:mps"):
            phase = np.mod(turned, 2 * np.pi) if self.bits is None else quantise_phase(turned, bits=self.bits)
            return phase, error_of(own, phase, part)
        return settled(backend_of(name, precision="double"), own, turned, part, self.bits)

    def _settings(self) -> dict[str, Setting]:
        acoustics = self.own.airs[0]
        settings: dict[str, Setting] = {
            "method": self.method,
            "level": self.level,
            "amplitudes": self.amplitudes,
            "fit": name_of_means(self.means),
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
        if self.ring is not None:
            settings |= {f"guard_{name}": value for name, value in _settings(self.ring).items()}
        return settings | {"array": self.own.array.name} | _settings(self.solver)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scene:
    """The target and the array in units of the strongest focus, in one air or in several; the first is its own."""

    target: AmplitudeFrames
    array: TransducerArray
    airs: tuple[Acoustics, ...]
    G: list[NDArray[np.complex128]]
    focus: float

    @classmethod
    def of(cls, target: AmplitudeFrames, array: TransducerArray, airs: tuple[Acoustics, ...]) -> "_Scene":
        G = [transfer_matrix(target.grid, array, acoustics=each) for each in airs]
        focus = float(np.abs(G[0]).sum(axis=1).max())
        # In units of the focus tolerances, weights and single precision fit any array.
        for each in G:
            each /= focus
        return cls(target=target, array=array, airs=airs, G=G, focus=focus)

    def problem(
        self,
        level: float | Literal["auto"],
        guard: Guard | None,
        means: Windows | Cells | None,
        smooth: float,
        ears: QuietEars | None,
        palm: QuietPalm | None,
    ) -> Problem:
        amplitude, grid, medium = self.target.amplitude / self.focus, self.target.grid, self.airs[0].medium
        unit = float(radiation_pressure(np.array(self.focus), medium))
        times = len(self.airs)
        return Problem(
            G=self.G[0] if times == 1 else np.concatenate(self.G),
            amplitude=np.tile(amplitude, (1, times)),
            level=automatic_level(amplitude) if level == "auto" else level,
            psi=psi_in_each(self.G, spreading_phase(grid, self.array, medium)),
            guard=self._quiet(guard, ears, palm),
            cells=None if means is None else means.target(amplitude, grid, unit).repeated(times),
            smooth=smooth,
            position=self.array.position,
        )

    def _quiet(self, guard: Guard | None, ears: QuietEars | None, palm: QuietPalm | None) -> GuardField | None:
        """Where the field is to be quiet: on the ring, at the ears, and on the palm around the control points."""
        field = None if guard is None else self._guarded(guard)
        none = GuardField(G=np.zeros((0, self.array.count), complex), ceiling=0.0, weight=1.0)
        # A mean over ears or palm counts as much as one over the control points, whose squares the error adds up.
        count = np.sqrt(len(self.G[0])) / self.focus
        if ears is not None:
            rows = np.concatenate([ears.rows(self.array, each) for each in self.airs])
            field = (field or none).and_quiet(count * rows, ears.weight)
        if palm is not None:
            rows = np.concatenate([palm.rows(self.target.grid, self.array, each) for each in self.airs])
            field = (field or none).and_quiet(count * rows, palm.weight)
        return field

    def _guarded(self, guard: Guard) -> GuardField:
        ring = guard.ring(self.target.grid)
        G = np.concatenate([transfer_matrix(ring, self.array, acoustics=each) for each in self.airs])
        return GuardField(G=G / self.focus, ceiling=guard.ceiling, weight=guard.weight)


def _check(level: object, bits: int | None, amplitudes: str, smooth: float, robust: float, quiet_ears: float) -> None:
    if level != "auto" and not (isinstance(level, int | float) and 0 < level <= 1):
        shown = f"{level:g}" if isinstance(level, int | float) else repr(level)
        raise InputError(f"level: expected above 0 and at most 1 of full drive, or auto, got {shown}")
    if bits is not None and not 1 <= bits <= 16:
        raise InputError(f"bits: expected 1 to 16 of a phase, or None, got {bits}")
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
    """The answer of the doubled problem as phases of the array, and the amplitude of each of its transducers."""
    phase, part = halves(answer.phase)
    if answer.level is not None:
        part = answer.level[:, None] * part
    return Answer(phase=phase, iterations=answer.iterations, status=answer.status), part


def _settings(chosen: Method | Guard) -> dict[str, Setting]:
    """The fields of a solver or a term, for the record, but for how many work at once, which changes nothing."""
    return {field.name: getattr(chosen, field.name) for field in fields(chosen) if field.name != "jobs"}
