"""A machine behind a pseudo-terminal, which a driver opens as if it were a serial port. POSIX only."""

import os
import threading
from abc import ABC, abstractmethod


class BehindPty(ABC):
    """One machine, run by a thread of its own from `switch_on` until `close`.

    Attributes
    ----------
    port : str
        Name of the pty; what a driver opens.
    """

    def __init__(self) -> None:
        import tty  # not on Windows

        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)

    def switch_on(self) -> None:
        """Begin to run, once everything is there that running needs."""
        self._thread.start()

    def close(self) -> None:
        """Switch it off."""
        self._halt()
        for end in (self._master, self._slave):
            if end >= 0:
                os.close(end)

    def unplug(self) -> None:
        """Pull the cable: writing fails from now on; what stands goes on standing."""
        self._halt()
        os.close(self._master)
        self._master = -1

    @abstractmethod
    def _run(self) -> None:
        """What the machine does until `_over` is set."""

    def _halt(self) -> None:
        self._over.set()
        self._thread.join()
