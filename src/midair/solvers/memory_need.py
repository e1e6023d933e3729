"""Estimate the memory that a solution needs before it is allocated."""

from typing import Any

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers.methods import SolverSettings
from midair.solvers.solve_plan import fits_at_once, folds, frames_per_part


def memory_of(
    target: AmplitudeFrames | tuple[ControlGrid, int],
    array: TransducerArray,
    settings: SolverSettings | None = None,
    *,
    acoustics: Acoustics | None = None,
    parts: bool = False,
    **changes: Any,
) -> int:
    """Maximum memory in bytes that `solve`, or `solve_parts` with `parts`, needs besides the memory in use already.

    It counts the arrays alive at once where there are most of them. A target that does not exist yet is its grid and
    number of frames.
    """
    settings = (settings or SolverSettings()).but(**changes)
    grid, frames = target if isinstance(target, tuple) else (target.grid, target.frames)
    if parts and not fits_at_once(frames, settings.solver()):
        frames = frames_per_part(settings.solver())
    airs = len(settings.airs(acoustics or Acoustics()))
    around = [*settings.quiet] if settings.ring is None else [settings.ring, *settings.quiet]
    M, N = airs * grid.count, array.count * (2 if settings.amplitudes == "bounded" else 1)
    guard = airs * sum(term.count(grid) for term in around)
    listeners, least = M + guard, min(M + guard, N)
    # Rows of G. Those of the guard exist alone and then below the others, both unweighted and weighted; a folded array
    # has those of all its places, and of each kind.
    rows = M * (2 if airs > 1 else 1) + (3 * listeners - M if guard else 0)
    rows += M + 2 * listeners if folds(settings) else 0
    # Modes: the Gram matrix, a copy, LAPACK's workspace. A batch: 40 numbers in single precision per frame and
    # transducer. The plain step of lm: six matrices of 2 M x 2 M half complex numbers.
    work = [16 * listeners * N + 80 * least**2, 160 * min(frames, 128) * N + 8 * least * (2 * listeners + 3 * N)]
    work += [112 * M * M + 8 * M * N] if settings.name == "lm" else []
    # Eight double-precision rows per frame of the answer: phases as found, held and rounded, the drive, that of the
    # part before, what `free` changes, and the results of blocks.
    return 16 * N * rows + 64 * frames * N + max(work)


def check_memory(needed: int, available: int | None, *, points: int, transducers: int) -> None:
    """Raise InputError if a problem needs more memory than is available; None means that this is unknown."""
    if available is not None and needed > available:
        # Memory grows with the points, or with their square for "lm".
        side = max(1, int((points * (available / needed)) ** 0.5))
        raise InputError(
            f"memory: expected a problem that fits into {available / 1e9:.3g} GB of free memory, got "
            f"{transducers} transducers x {points} points, which need about {needed / 1e9:.3g} GB; "
            f"use fewer array units or frames at once, or fewer points, about {side} x {side}"
        )
