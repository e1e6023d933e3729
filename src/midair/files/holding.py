"""Files and folders that one program at a time may write to."""

from contextlib import suppress

from midair.errors import DeviceStateError


def hold(handle: int, refusal: str) -> None:
    """Lock an open file or folder where the system can; the lock goes with the process, however it dies.

    Parameters
    ----------
    handle : int
        Of the open file or folder; closing it lets go.
    refusal : str
        What to say when another program holds it.

    Raises
    ------
    DeviceStateError
        If another program does.
    """
    with suppress(ImportError):  # there is no such lock on Windows
        from fcntl import LOCK_EX, LOCK_NB, flock

        try:
            flock(handle, LOCK_EX | LOCK_NB)
        except OSError as held:
            raise DeviceStateError(refusal) from held
