import os
import threading
import time

import pytest

from midair.errors import DeviceStateError, InputError, LinkLostError
from midair.studio.worker_process import NO_ANSWER, WorkerProcess


def work(pipe, name):
    """Main function of the process of these tests."""

    def act(order):
        match order["do"]:
            case "add":
                return order["value"] + 1
            case "lost":
                raise LinkLostError("no units")
            case "break":
                raise ValueError("not foreseen")
            case "late":
                pipe.send("event", name=name)
                pipe.answer(order, "later")
                return NO_ANSWER
            case "hang":
                return time.sleep(600)
            case _:
                return os._exit(3)

    pipe.serve(act)


class Worker:
    """A worker process, its events, and whether it ended by itself."""

    def __init__(self):
        self.events, self.ended = [], threading.Event()
        self.process = WorkerProcess(
            work, self.events.append, name="test", absent="no process", gone="it died", on_end=self.ended.set
        )
        self.process.start("first")

    def ask(self, do, **order):
        return self.process.request(do, **order).result(120)


@pytest.fixture(scope="module")
def worker():
    """One worker for all tests, since a process starts slowly."""
    made = Worker()
    yield made
    made.process.close(5)


def test_answers_errors_and_events_arrive(worker):
    assert worker.ask("add", value=1) == 2
    with pytest.raises(LinkLostError, match="no units"):
        worker.ask("lost")
    with pytest.raises(InputError, match="please report it: ValueError: not foreseen"):
        worker.ask("break")
    assert worker.ask("late") == "later"
    assert worker.events == [{"kind": "event", "name": "first"}]
    assert worker.ask("add", value=2) == 3, "failed requests do not end the process"


@pytest.mark.long
def test_request_fails_when_its_process_dies_and_the_process_can_be_started_again(worker):
    worker.events.clear()
    with pytest.raises(DeviceStateError, match="it died"):
        worker.ask("die")
    assert worker.ended.wait(30)
    assert (worker.events, worker.process.process) == ([{"kind": "gone"}], 0)
    with pytest.raises(DeviceStateError, match="no process"):
        worker.ask("add", value=1)
    with pytest.raises(DeviceStateError, match="no process"):
        worker.process.send("add")
    worker.process.start("second")
    worker.ask("late")
    assert worker.events[1:] == [{"kind": "event", "name": "second"}]


@pytest.mark.long
def test_hanging_process_is_terminated_without_an_event(worker):
    if not worker.process.process:
        worker.process.start("third")
    worker.ask("add", value=1)
    worker.events.clear()
    worker.ended.clear()
    answer = worker.process.request("hang")
    worker.process.close(0.2)
    assert worker.process.process == 0
    with pytest.raises(DeviceStateError, match="it died"):
        answer.result(30)
    assert worker.events == []
    assert not worker.ended.is_set()
