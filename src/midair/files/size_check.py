"""What has to be in memory as a whole is refused before it is read, where the memory is not there."""

from midair import ram
from midair.errors import InputError


def check_fits(needed: float, what: str, advice: str) -> None:
    """Refuse what takes more memory than is free, before it takes any of it.

    Parameters
    ----------
    needed : float
        Bytes, at least.
    what, advice : str
        For the message.

    Raises
    ------
    InputError
        If the system says that it has less.
    """
    free = ram.available()
    if free is not None and needed > free:
        raise InputError(
            f"{what}: expected {needed / 1e9:.3g} GB of free memory, since all of it is held at once, got "
            f"{free / 1e9:.3g} GB; {advice}"
        )
