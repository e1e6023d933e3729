"""Files and folders that one program at a time may write to."""

from contextlib import suppress

from midair.errors import DeviceStateError, FileError


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
    FileError
        If the disk has no locks, as some network disks.
    """
    with suppress(ImportError):  # there is no such lock on Windows
        from fcntl import LOCK_EX, LOCK_NB, flock

        try:
            flock(handle, LOCK_EX | LOCK_NB)
        except BlockingIOError as held:
            raise DeviceStateError(refusal) from held
        except OSError as wrong:
            what, _, _ = refusal.partition(":")
            raise FileError(
                f"{what}: expected a disk that can keep a second program out, got: {wrong.strerror}; "
                "put it on a disk of this computer"
            ) from wrong
