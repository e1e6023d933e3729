import os
import threading
import time

import pytest

from midair.errors import InputError
from midair.studio.jobs import Jobs


def add_one(order, progress):
    for done in range(3):
        progress("adding", done, 3)
    return order + 1


def fail(order, progress):
    raise InputError("expected something else")


def break_down(order, progress):
    raise ValueError("nobody foresaw this")


def die(order, progress):
    os._exit(3)


def wait(order, progress):
    progress("waiting", 1, 2)
    time.sleep(60)


class Watch:
    def __init__(self):
        self.seen, self.ended = [], {}
        self.runs = threading.Event()
        self.over = threading.Semaphore(0)

    def changed(self, job):
        self.seen.append((job.title, job.state, job.stage))
        if job.stage == "waiting":
            self.runs.set()

    def done(self, job):
        self.ended[job.title] = (job.state, job.result, job.error)
        self.over.release()

    def await_(self, count):
        for _ in range(count):
            assert self.over.acquire(timeout=240)


@pytest.fixture(scope="module")
def shared():
    """One worker for all tests that do not end it, since a process starts slowly."""
    watch = Watch()
    jobs = Jobs(watch.changed)
    yield jobs, watch
    jobs.close()


def test_jobs_run_in_sequence_and_failures_have_messages(shared):
    jobs, watch = shared
    jobs.add("first", add_one, 1, ended=watch.done)
    jobs.add("bad", fail, None, ended=watch.done)
    jobs.add("broken", break_down, None, ended=watch.done)
    jobs.add("last", add_one, 41, ended=watch.done)
    watch.await_(4)
    assert (watch.ended["first"], watch.ended["bad"]) == (("done", 2, ""), ("failed", None, "expected something else"))
    assert watch.ended["broken"][0] == "failed"
    assert "please report it: ValueError: nobody foresaw this" in watch.ended["broken"][2]
    assert watch.ended["last"] == ("done", 42, "")


@pytest.mark.long
def test_running_and_waiting_jobs_are_cancelled_and_the_next_gets_a_new_process(shared):
    jobs, watch = shared
    running = jobs.add("running", wait, None, ended=watch.done)
    waiting = jobs.add("waiting its turn", add_one, 0, ended=watch.done)
    jobs.add("afterwards", add_one, 6, ended=watch.done)
    assert watch.runs.wait(30)
    assert [job.title for job in jobs.unfinished()] == ["running", "waiting its turn", "afterwards"]
    before = jobs.process
    assert jobs.cancel(waiting.number)
    assert jobs.cancel(running.number)
    assert not jobs.cancel(running.number)
    watch.await_(3)
    assert watch.ended["running"][0] == watch.ended["waiting its turn"][0] == "cancelled"
    assert watch.ended["afterwards"] == ("done", 7, "")
    assert jobs.process != before
    jobs.add("deadly", die, None, ended=watch.done)
    jobs.add("after death", add_one, 1, ended=watch.done)
    watch.await_(2)
    assert watch.ended["deadly"][0] == "failed"
    assert "ended" in watch.ended["deadly"][2]
    assert watch.ended["after death"] == ("done", 2, "")
