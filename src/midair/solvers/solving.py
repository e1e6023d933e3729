"""From the sound amplitude that is wanted to the drive that makes it: the stage of the pipeline."""

from dataclasses import dataclass, fields
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, Drive, Progress, Setting, Solution, TransducerArray
from midair.physics import quantise_phase, radiation_pressure, transfer_matrix
from midair.solvers.amplitudes import Amplitudes, doubled, halves
from midair.solvers.lens import spreading_phase
from midair.solvers.methods import Method, check_terms, name_of
from midair.solvers.methods import solver as solver_of
from midair.solvers.problem import Answer, Problem, Start, Term, error_of
from midair.solvers.terms import Cells, Guard, GuardField, QuietEars, airs_around, automatic_level, psi_in_each
from midair.solvers.threads import one_blas_thread

Array = NDArray[np.float64]
Fit = Literal["points", "cells"] | Cells
"""What the error is taken over: the control points, as in the paper, or the cells of the sensor."""


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
    fit : {"points", "cells"} or Cells
        What is to be met: the target at the control points, or what the cells of a sensor read of it. The error is
        that of what was to be met.
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
    solver = solver_of(method, iterations=iterations, start=start, backend=backend, jobs=jobs)
    _check(level, bits, amplitudes, fit, smooth, robust, quiet_ears)
    acoustics = acoustics or Acoustics()
    ring = Guard(margin=guard) if isinstance(guard, int | float) else guard
    asked: set[Term] = {"amplitudes"} if amplitudes == "bounded" else set()
    asked |= {"robust"} if robust > 0 else set()
    asked |= {"quiet-ears"} if quiet_ears > 0 else set()
    ears = QuietEars(weight=quiet_ears) if quiet_ears > 0 else None
    cells = Cells() if fit == "cells" else None if fit == "points" else fit
    own = _Scene.of(target, array, (acoustics,)).problem(level, ring, cells, smooth, ears)
    airs = airs_around(acoustics, robust)
    problem = own if len(airs) == 1 else _Scene.of(target, array, airs).problem(level, ring, cells, smooth, ears)
    check_terms(method, asked | problem.terms)
    with one_blas_thread():
        if amplitudes == "bounded":
            answer, part = _bounded(solver.solve(doubled(problem), progress=progress))
        else:
            answer = solver.solve(problem, progress=progress)
            part = answer.level
        # Rounded before the error is taken, so that it is the error of what will be played.
        phase = np.mod(answer.phase, 2 * np.pi) if bits is None else quantise_phase(answer.phase, bits=bits)
        error = error_of(own, phase, part)
    audible = np.array([status != "silent" for status in answer.status], float)
    # Transposed twice, so that (frame,) and (frame, transducer) are both multiplied frame by frame.
    played = problem.level * (audible if part is None else (audible * part.T).T)
    settings: dict[str, Setting] = {
        "method": name_of(method),
        "level": problem.level,
        "amplitudes": amplitudes,
        "fit": "points" if problem.cells is None else "cells",
        "smooth": smooth,
        "robust_c": robust,
        "quiet_ears": quiet_ears,
        "bits": bits,
        "directivity": acoustics.directivity,
        "speed_m_s": acoustics.medium.speed,
        "temperature_c": acoustics.medium.temperature,
        "humidity": acoustics.medium.humidity,
    }
    if ring is not None:
        settings |= {f"guard_{name}": value for name, value in _settings(ring).items()}
    drive = Drive(
        phase=phase,
        level=played,
        rate=target.rate,
        array=array,
        acoustics=acoustics,
        provenance=target.provenance.then("solve", settings | {"array": array.name} | _settings(solver)),
    )
    return Solution(drive=drive, error=error, iterations=answer.iterations, status=answer.status)


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
        return cls(target=target, array=array, airs=airs, G=[each / focus for each in G], focus=focus)

    def problem(
        self,
        level: float | Literal["auto"],
        guard: Guard | None,
        cells: Cells | None,
        smooth: float,
        ears: QuietEars | None,
    ) -> Problem:
        amplitude, grid, medium = self.target.amplitude / self.focus, self.target.grid, self.airs[0].medium
        unit = float(radiation_pressure(np.array(self.focus), medium))
        times = len(self.airs)
        return Problem(
            G=np.concatenate(self.G),
            amplitude=np.tile(amplitude, (1, times)),
            level=automatic_level(amplitude) if level == "auto" else level,
            psi=psi_in_each(self.G, spreading_phase(grid, self.array, medium)),
            guard=self._quiet(guard, ears),
            cells=None if cells is None else cells.target(amplitude, grid, unit).repeated(times),
            smooth=smooth,
        )

    def _quiet(self, guard: Guard | None, ears: QuietEars | None) -> GuardField | None:
        """Where the field is to be quiet: on the ring, and at the ears."""
        field = None if guard is None else self._guarded(guard)
        if ears is None:
            return field
        rows = np.concatenate([ears.rows(self.array, each) for each in self.airs]) / self.focus
        # A mean over the ears counts as much as a mean over the control points, whose squares the error adds up.
        rows *= np.sqrt(len(self.G[0]))
        none = GuardField(G=np.zeros((0, self.array.count), complex), ceiling=0.0, weight=1.0)
        return (field or none).and_quiet(rows, ears.weight)

    def _guarded(self, guard: Guard) -> GuardField:
        ring = guard.ring(self.target.grid)
        G = np.concatenate([transfer_matrix(ring, self.array, acoustics=each) for each in self.airs])
        return GuardField(G=G / self.focus, ceiling=guard.ceiling, weight=guard.weight)


def _check(
    level: object, bits: int | None, amplitudes: str, fit: object, smooth: float, robust: float, quiet_ears: float
) -> None:
    if level != "auto" and not (isinstance(level, int | float) and 0 < level <= 1):
        shown = f"{level:g}" if isinstance(level, int | float) else repr(level)
        raise InputError(f"level: expected above 0 and at most 1 of full drive, or auto, got {shown}")
    if bits is not None and not 1 <= bits <= 16:
        raise InputError(f"bits: expected 1 to 16 of a phase, or None, got {bits}")
    if amplitudes not in get_args(Amplitudes):
        raise InputError(f"amplitudes: expected {' or '.join(get_args(Amplitudes))}, got {amplitudes!r}")
    if not (isinstance(fit, Cells) or fit in ("points", "cells")):
        raise InputError(f"fit: expected points, cells, or Cells(...), got {fit!r}")
    if not 0 <= smooth < np.inf:
        raise InputError(f"smooth: expected 0 or more, got {smooth:g}")
    if not 0 <= robust <= 10:
        raise InputError(f"robust: expected 0 to 10 degrees Celsius, got {robust:g}")
    if not 0 <= quiet_ears < np.inf:
        raise InputError(f"quiet_ears: expected 0 or more, got {quiet_ears:g}")


def _bounded(answer: Answer) -> tuple[Answer, Array]:
    """The answer of the doubled problem as phases of the array, and the amplitude of each of its transducers."""
    phase, part = halves(answer.phase)
    if answer.level is not None:
        part = answer.level[:, None] * part
    return Answer(phase=phase, iterations=answer.iterations, status=answer.status), part


def _settings(chosen: Method | Guard) -> dict[str, Setting]:
    """The fields of a solver or a term, for the record, but for how many work at once, which changes nothing."""
    return {field.name: getattr(chosen, field.name) for field in fields(chosen) if field.name != "jobs"}
