"""From when something is ordered to play until its array is let go: the array is ours, and can be silenced for good."""

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
    """Of one array, which makes one for its whole life; may be entered again while it is held.

    Once somebody has asked for silence nothing sounds until the outermost block was left.
    """

    def __init__(self) -> None:
        # Whatever makes sound takes it, and so does whoever silences.
        self._sound = threading.RLock()
        self._entering = threading.RLock()
        self._entered = 0
        self._stopped = threading.Event()
        self._stack = ExitStack()

    @property
    def stopped(self) -> bool:
        """Whether somebody asked for silence."""
        return self._stopped.is_set()

    @contextmanager
    def held(self, name: str, device: str | None, silence: Callable[[], None]) -> Generator[None]:
        """While inside, `midair stop` reaches the array, and no other program gets it.

        Parameters
        ----------
        name : str
            Of the array.
        device : str or None
            What no other program may have meanwhile, see `device_lock`; None where each gets its own.
        silence : callable
            Silences it, from any thread.
        """
        self._enter(name, device, silence)
        try:
            yield
        except KeyboardInterrupt:
            # By which `_interrupt` ends what keeps the main thread busy.
            if self.stopped:
                raise StoppedError(_stopped(name)) from None
            raise
        finally:
            self._leave()

    @contextmanager
    def sounding(self, name: str) -> Generator[None]:
        """Inside, sound may begin: nobody silences meanwhile.

        Raises
        ------
        StoppedError
            If somebody asked for silence.
        """
        with self._sound:
            self.check(name)
            yield

    def check(self, name: str) -> None:
        """Raise StoppedError if somebody asked for silence."""
        if self.stopped:
            raise StoppedError(_stopped(name))

    def _enter(self, name: str, device: str | None, silence: Callable[[], None]) -> None:
        with self._entering:
            if self._entered == 0:
                main = threading.current_thread() is threading.main_thread()
                with ExitStack() as stack:
                    if device is not None:
                        stack.enter_context(device_lock(device))
                    afterwards = _interrupt if main else _nothing
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
            # First the refusal of more, then the silence: in the other order something could begin in between.
            self._stopped.set()
            silence()


def _interrupt() -> None:
    """End what the main thread is busy with, such as opening; nothing happens where SIGINT is ignored."""
    if not callable(signal.getsignal(signal.SIGINT)):
        return
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # A signal of the system's ends a wait as well, where `interrupt_main` does not.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _nothing() -> None:
    """A thread cannot be interrupted: it finds out when it comes to play."""


def _stopped(name: str) -> str:
    return f"{name}: silenced by midair stop; play again when it is safe"
