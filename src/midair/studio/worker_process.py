"""Worker processes of the studio: requests and their answers over a pipe, events, and the end of either process."""

import asyncio
import itertools
import operator
import os
import signal
import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from multiprocessing import Pipe, connection, parent_process
from multiprocessing.connection import Connection
from typing import Any

from midair import errors
from midair.errors import DeviceStateError, InputError, MidairError
from midair.processes import start_process

NO_ANSWER = object()
"""Result of a request that is answered later, by `StudioPipe.answer`."""


class WorkerProcess:
    """A child process that runs ``target(StudioPipe, *arguments)``; it can be started again after its end.

    `call` runs `on_event` on each message of the process that is not an answer, and on ``{"kind": "gone"}`` after it
    ended by itself and was not started again. In that case `on_end` runs at once, in a thread. `absent` is the error of
    a request without a process, `gone` that of a request whose process ended.
    """

    def __init__(
        self,
        target: Callable[..., None],
        on_event: Callable[[dict[str, Any]], None],
        *,
        name: str,
        absent: str,
        gone: str,
        call: Callable[..., Any] | None = None,
        on_end: Callable[[], None] = lambda: None,
        daemon: bool = True,
    ) -> None:
        self._target, self._on_event, self._on_end = target, on_event, on_end
        self._call = call or operator.call
        self._name, self._absent, self._gone, self._daemon = name, absent, gone, daemon
        self._lock = threading.RLock()
        self._process: Any = None
        self._pipe: Connection | None = None
        self._waiting: dict[int, Future[Any]] = {}
        self._numbers = itertools.count(1)

    @property
    def process(self) -> int:
        """Process ID; 0 if there is no process."""
        process = self._process
        return process.pid if process is not None and process.is_alive() else 0

    def start(self, *arguments: Any) -> None:
        """Start the process."""
        pipe, there = Pipe()
        process = start_process(_run, self._target, there, arguments, name=f"midair {self._name}", daemon=self._daemon)
        there.close()
        with self._lock:
            self._process, self._pipe, self._waiting = process, pipe, {}
        threading.Thread(target=self._listen, args=(pipe, self._waiting), name=self._name, daemon=True).start()

    def send(self, do: str, **order: Any) -> None:
        """Send a request without an answer; DeviceStateError if there is no process."""
        with self._lock:
            if self._pipe is None:
                raise DeviceStateError(self._absent)
            # The thread that listens reports a process that has just ended.
            with suppress(OSError):
                self._pipe.send({"do": do, **order})

    def request(self, do: str, **order: Any) -> Future[Any]:
        """Send a request and return its answer to come, which is a DeviceStateError if the process has ended."""
        done, number = Future[Any](), next(self._numbers)
        # A caller that is cancelled must not cancel what the process does.
        done.set_running_or_notify_cancel()
        with self._lock:
            self._waiting[number] = done
            try:
                self.send(do, id=number, **order)
            except DeviceStateError as wrong:
                done.set_exception(wrong)
        return done

    async def ask(self, do: str, **order: Any) -> Any:
        """Send a request and await its answer."""
        return await asyncio.wrap_future(self.request(do, **order))

    def close(self, patience: float = 0.0) -> None:
        """End the process: ask it to end, and terminate it after `patience` s."""
        with self._lock:
            process, pipe = self._process, self._pipe
            self._process = self._pipe = None
        if process is None or pipe is None:
            return
        if patience:
            with suppress(OSError):
                pipe.send(None)
            process.join(patience)
        for end in (process.terminate, process.kill):
            if process.is_alive():
                end()
                process.join(2)

    def _listen(self, pipe: Connection, waiting: dict[int, Future[Any]]) -> None:
        with pipe:
            while True:
                try:
                    said = pipe.recv()
                except (EOFError, OSError):
                    break
                self._call(self._on_message, pipe, waiting, said)
        by_itself = pipe is self._pipe
        self._call(self._ended, pipe, waiting)
        if by_itself:
            self._on_end()

    def _ended(self, pipe: Connection, waiting: dict[int, Future[Any]]) -> None:
        with self._lock:
            current = pipe is self._pipe
            if current:
                self._process = self._pipe = None
            left = [done for done in waiting.values() if not done.done()]
        for done in left:
            done.set_exception(DeviceStateError(self._gone))
        if current:
            self._on_event({"kind": "gone"})

    def _on_message(self, pipe: Connection, waiting: dict[int, Future[Any]], said: dict[str, Any]) -> None:
        if said["kind"] in ("answer", "wrong"):
            if (done := waiting.pop(said["id"], None)) is None:
                return
            if said["kind"] == "answer":
                done.set_result(said["value"])
            else:
                done.set_exception(_error_class(said["of"])(said["error"]))
        elif pipe is self._pipe:
            self._on_event(said)


class StudioPipe:
    """The pipe of a worker process to its studio."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._lock, self._ended = pipe, threading.Lock(), False

    def send(self, kind: str, **said: Any) -> bool:
        """Send an event, from any thread; False if the studio has ended."""
        with suppress(OSError, ValueError), self._lock:
            self._pipe.send({"kind": kind, **said})
            return True
        return False

    def poll(self, patience: float = 0.0) -> bool:
        """True if `receive` would not wait."""
        return self._ended or self._pipe.poll(patience)

    def receive(self) -> dict[str, Any] | None:
        """Return the next request; None if this process is to end."""
        try:
            order = None if self._ended else self._pipe.recv()
        except (EOFError, OSError):
            order = None
        self._ended = order is None
        return order

    def serve(self, act: Callable[[dict[str, Any]], Any]) -> None:
        """Answer one request after the other with the result of `act`."""
        while (order := self.receive()) is not None:
            self.handle(order, act)

    def handle(self, order: dict[str, Any], act: Callable[[dict[str, Any]], Any]) -> None:
        """Answer one request."""
        with self.answering(order):
            if (value := act(order)) is not NO_ANSWER:
                self.answer(order, value)

    def answer(self, order: dict[str, Any], value: Any) -> None:
        """Send the result of a request."""
        self.send("answer", id=order.get("id", 0), value=value)

    @contextmanager
    def answering(self, order: dict[str, Any]) -> Generator[None]:
        """Answer a request by the error of the block, if it fails; the process goes on."""
        try:
            yield
        except MidairError as wrong:
            self.send("wrong", id=order.get("id", 0), error=str(wrong), of=type(wrong).__name__)
        except Exception as wrong:  # noqa: BLE001  # a failed request must not end the process
            said = f"this is an error in midair, please report it: {type(wrong).__name__}: {wrong}"
            self.send("wrong", id=order.get("id", 0), error=said, of="unforeseen")


def end_with_studio(*silence: Callable[[], Any], patience: float) -> None:
    """When the studio has ended, call each function, and end this process after `patience` s."""
    studio = parent_process()

    def wait() -> None:
        if studio is None:
            return
        connection.wait([studio.sentinel])
        for each in silence:
            with suppress(Exception):
                each()
        # The main thread reads the stopped lease and closes the device; wait for that, but not forever.
        time.sleep(patience)
        os._exit(0)

    threading.Thread(target=wait, name="studio", daemon=True).start()


def _run(target: Callable[..., None], pipe: Connection, arguments: tuple[Any, ...]) -> None:
    # Ctrl-C in the terminal reaches the studio, which then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    target(StudioPipe(pipe), *arguments)


def _error_class(name: str) -> type[MidairError]:
    """Return the error class of a name, so that callers can distinguish errors of a process."""
    kind = getattr(errors, name, InputError)
    return kind if isinstance(kind, type) and issubclass(kind, MidairError) else InputError
