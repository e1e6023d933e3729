"""Estimate the memory that a solution needs before it is allocated.

The estimate counts the arrays alive at once where there are most of them; tests compare it with the memory measured by
the system (docs/sweep.md has both).
"""

from typing import Any

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers.methods import SolverSettings
from midair.solvers.solve_plan import folds, frames_per_part, settings_with

_EIGEN = 5
"""Matrices of the size of G G^H during its eigendecomposition: itself, a copy, LAPACK's workspace."""
_DESCENT = 40
"""Single-precision rows of one number per transducer that each frame of a batch needs."""
_ROWS = 128
_ANSWER = 10
"""Double-precision rows per frame of the answer: phases as found, held and rounded, the drive, that of the part before,
two complex numbers per transducer for the error, and the results of blocks.
"""
_PLAIN = 6
"""Matrices of 2 M x 2 M half complex numbers in the plain form of the step."""


def memory_needed(
    points: int, transducers: int, frames: int, *, method: str, guard: int = 0, airs: int = 1, folded: bool = False
) -> int:
    """Maximum memory in bytes that solving needs, besides the memory in use already.

    Transducers count twice with bounded amplitudes. `frames` are those of one call, for `solve_parts` of a part;
    `guard` counts the points outside the control grid that shall be quiet, `airs` the temperatures that are solved for
    at once (`terms.temperatures`). `folded` means by the array's mirrors (`solve_plan.folds`).
    """
    M, N = airs * points, transducers
    listeners = M + airs * guard
    # The guard's rows exist alone and then below the others, both unweighted and weighted.
    G = 16 * M * N * (2 if airs > 1 else 1) + (16 * N * (listeners - M + 2 * listeners) if guard else 0)
    # G of all places of the lattice, and the fields of each kind, which remain with their modes.
    places = 16 * N * (M + 2 * listeners) if folded else 0
    answer = _ANSWER * 8 * frames * N
    gram = 16 * M * M + _PLAIN * 16 * M * M + 8 * M * N
    batch = min(frames, _ROWS) * 4 * _DESCENT * N + 8 * min(listeners, N) * (2 * listeners + 3 * N)
    work = max(_modes(listeners, N), batch, gram if method == "lm" else 0)
    return G + places + work + answer


def memory_of(
    target: AmplitudeFrames | tuple[ControlGrid, int],
    array: TransducerArray,
    settings: SolverSettings | None = None,
    *,
    acoustics: Acoustics | None = None,
    bits: int | None = None,  # noqa: ARG001
    parts: bool = False,
    **changes: Any,
) -> int:
    """Maximum memory in bytes that `solve`, or `solve_parts` with `parts`, needs with these settings.

    `bits` is accepted for the sake of `solve` and does not matter. A target that does not exist yet is its grid and
    number of frames.
    """
    settings = settings_with(settings, changes)
    grid, frames = target if isinstance(target, tuple) else (target.grid, target.frames)
    around = [*settings.quiet] if settings.ring is None else [settings.ring, *settings.quiet]
    return memory_needed(
        grid.count,
        array.count * (2 if settings.amplitudes == "bounded" else 1),
        min(frames, frames_per_part(settings.solver())) if parts else frames,
        method=settings.name,
        guard=sum(term.count(grid) for term in around),
        airs=len(settings.airs(acoustics or Acoustics())),
        folded=folds(settings),
    )


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


def _modes(M: int, N: int) -> int:
    """Memory in bytes while the modes of an M x N matrix are computed, see `modes.modes`."""
    least = min(M, N)
    gram = 16 * M * N + _EIGEN * 16 * least**2
    # A sketch stops at three quarters of the modes plus one block.
    most = 7 * least // 8
    return max(gram, 2 * 16 * (M + N) * most) if M >= 2000 else gram
