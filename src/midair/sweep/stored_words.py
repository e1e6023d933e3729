"""What a store says of its sweep, where somebody may have changed it."""

from collections.abc import Generator
from contextlib import contextmanager

from midair.errors import BrokenFileError, MidairError


@contextmanager
def as_stored() -> Generator[None]:
    """Say in one line that settings, coordinates or results of a store are not as midair stores them.

    Raises
    ------
    BrokenFileError
        If the block stumbles over them.
    """
    try:
        yield
    except MidairError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as wrong:
        said = " ".join(f"{type(wrong).__name__}: {wrong}".split())[:120]
        raise BrokenFileError(
            f"sweep: expected settings and results of midair, got others ({said}); the store is damaged"
        ) from wrong
