"""Reservation of an array and its stop channel, from the order to play until the array is released."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager

from midair.devices.safety.device_locks import device_lock
from midair.devices.safety.stop_channel import open_stop_channel
from midair.errors import StoppedError


class StopGuard:
    """Guard of one array, reentrant; after a stop nothing sounds until the outermost block ends."""

    def __init__(self) -> None:
        # Held while sound starts, and while silencing.
        self._sound = threading.RLock()
        self._entering = threading.RLock()
        self._entered = 0
        self._stopped = threading.Event()
        self._stack = ExitStack()

    @property
    def stopped(self) -> bool:
        """True after a stop request."""
        return self._stopped.is_set()

    @contextmanager
    def held(self, name: str, device: str | None, silence: Callable[[], None]) -> Generator[None]:
        """While inside, `midair stop` reaches the array `name`, and no other program gets `device` (None: no lock).

        `silence` must be callable from any thread.
        """
        self._enter(name, device, silence)
        try:
            yield
        except KeyboardInterrupt:
            # `_interrupt` raised it to interrupt the main thread.
            if self.stopped:
                raise StoppedError(_stopped(name)) from None
            raise
        finally:
            self._leave()

    @contextmanager
    def sounding(self, name: str) -> Generator[None]:
        """Inside, sound may begin and a stop waits; raises StoppedError after a stop request."""
        with self._sound:
            self.check(name)
            yield

    def check(self, name: str) -> None:
        """Raise StoppedError after a stop request."""
        if self.stopped:
            raise StoppedError(_stopped(name))

    def _enter(self, name: str, device: str | None, silence: Callable[[], None]) -> None:
        with self._entering:
            if self._entered == 0:
                main = threading.current_thread() is threading.main_thread()
                with ExitStack() as stack:
                    if device is not None:
                        stack.enter_context(device_lock(device))
                    # Only the main thread can be interrupted; others check before they play.
                    afterwards = _interrupt if main else lambda: None
                    line = open_stop_channel(name, lambda: self._stop(silence), afterwards=afterwards)
                    stack.enter_context(line)
                    self._stack = stack.pop_all()
            self._entered += 1

    def _leave(self) -> None:
        with self._entering:
            self._entered -= 1
            if self._entered == 0:
                try:
                    self._stack.close()
                finally:
                    self._stopped.clear()

    def _stop(self, silence: Callable[[], None]) -> None:
        with self._sound:
            # Refuse new sound first, then silence: in the other order sound could begin in between.
            self._stopped.set()
            silence()


def _interrupt() -> None:
    """Interrupt the main thread, for example during opening; no effect if SIGINT is ignored."""
    if not callable(signal.getsignal(signal.SIGINT)):
        return
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # A system signal also ends a blocking wait, `interrupt_main` does not.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _stopped(name: str) -> str:
    return f"{name}: silenced by midair stop; play again when it is safe"
