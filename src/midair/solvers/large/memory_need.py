"""How much memory a problem takes, known before any of it is taken.

Counted from the arrays that are alive at once, in the few places where there are most of them; which those are, and
that nothing was forgotten, is tested against what the system saw (`python -m benchmarks.scale` prints both).
"""

from midair.errors import InputError

_EIGEN = 5
"""Matrices of the size of G G^H while its eigenvectors are worked out: itself, their copy, LAPACK's room for work."""
_DESCENT = 40
"""Rows of single precision, one number a transducer, that a frame of a batch has on the way."""
_ROWS = 128
_ANSWER = 10
"""Rows of double precision that a frame of the answer has: its phases as found, held and rounded, the drive, that of
the part before, and two complex numbers a transducer while the error is worked out; the rest is what blocks leave."""
_PLAIN = 6
"""Matrices of 2 M x 2 M halves of a complex number, in the plain form of the paper's step."""


def memory_needed(points: int, transducers: int, frames: int, *, method: str, guard: int = 0, airs: int = 1) -> int:
    """Bytes that solving takes at most at once, beside what the program has already.

    Parameters
    ----------
    points : int
        Control points.
    transducers : int
        Of the array; twice as many with bounded amplitudes.
    frames : int
        That are solved in one call; of `solve_parts`, those of a part.
    method : str
        A name in `methods.METHODS`.
    guard : int
        Points that are to stay quiet.
    airs : int
        Temperatures that are to be held at once, see `terms.temperatures`.
    """
    M, N = airs * points, transducers
    heard = M + airs * guard
    # The guard's rows stand alone, then below the others, as they are heard and as they weigh.
    G = 16 * M * N * (2 if airs > 1 else 1) + (16 * N * (heard - M + 2 * heard) if guard else 0)
    answer = _ANSWER * 8 * frames * N
    gram = 16 * M * M + _PLAIN * 16 * M * M + 8 * M * N
    if method in ("exact", "fast", "glide", "live"):
        batch = min(frames, _ROWS) * 4 * _DESCENT * N + 8 * min(heard, N) * (2 * heard + 3 * N)
        work = max(_modes(heard, N), batch, gram if method == "exact" else 0)
    else:
        work = gram if method == "lm" else 16 * M * N
    return G + work + answer


def check_memory(needed: int, available: int | None, *, points: int, transducers: int) -> None:
    """Refuse what would not fit, where the system says how much would.

    Raises
    ------
    InputError
        If more is needed than is available.
    """
    if available is not None and needed > available:
        raise InputError(
            f"memory: expected a problem that fits into the {available / 1e9:.3g} GB that are free, got "
            f"{transducers} transducers x {points} points, which take about {needed / 1e9:.3g} GB; "
            "ask for fewer points, units or frames at once"
        )


def _modes(M: int, N: int) -> int:
    """While the modes of an M x N matrix are worked out, see `modes.modes`."""
    least = min(M, N)
    gram = 16 * M * N + _EIGEN * 16 * least**2
    # A sketch gives up at three quarters of the modes and a block more.
    most = 7 * least // 8
    return max(gram, 2 * 16 * (M + N) * most) if M >= 2000 else gram
