"""Errors for stores of sweeps that were damaged or edited."""

from collections.abc import Generator
from contextlib import contextmanager

from midair.errors import BrokenFileError, MidairError


@contextmanager
def store_errors_raised() -> Generator[None]:
    """Turn errors from invalid settings, coordinates or results of a store into a BrokenFileError."""
    try:
        yield
    except MidairError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as wrong:
        cause = " ".join(f"{type(wrong).__name__}: {wrong}".split())[:120]
        raise BrokenFileError(
            f"sweep: expected settings and results of midair, got others ({cause}); the store is damaged"
        ) from wrong
