"""Check for sufficient memory before a file is read as a whole."""

from midair import ram
from midair.errors import InputError


def check_memory_for(needed: float, what: str, advice: str) -> None:
    """Raise InputError if fewer than `needed` bytes of memory are free; `what` and `advice` are for the message."""
    free = ram.available_memory()
    if free is not None and needed > free:
        raise InputError(
            f"{what}: expected {needed / 1e9:.3g} GB of free memory, because all of it is read at once, got "
            f"{free / 1e9:.3g} GB; {advice}"
        )
