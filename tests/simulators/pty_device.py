"""Base class of simulated devices behind a pseudo-terminal, which a driver opens like a serial port. POSIX only."""

import os
import threading
from abc import ABC, abstractmethod


class BehindPty(ABC):
    """A simulated device; its thread runs from `switch_on` until `close`."""

    def __init__(self) -> None:
        import tty  # not on Windows

        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)

    def switch_on(self) -> None:
        """Start the thread; called last in __init__."""
        self._thread.start()

    def close(self) -> None:
        self._halt()
        for end in (self._master, self._slave):
            if end >= 0:
                os.close(end)

    def unplug(self) -> None:
        """Disconnect the cable: the driver can no longer write; the device keeps its state."""
        self._halt()
        os.close(self._master)
        self._master = -1

    @abstractmethod
    def _run(self) -> None:
        """Simulate the device until `_over` is set."""

    def _halt(self) -> None:
        self._over.set()
        self._thread.join()
