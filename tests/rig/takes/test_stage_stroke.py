import threading
import time

import numpy as np
import pytest
from tests.waiting import wait_until

from midair.devices import ReplaySensor, WrappedSensor
from midair.errors import DeviceError
from midair.files import open_take
from midair.model import Recording, StageSetup, StageStamp
from midair.rig.takes.stage_strokes import StageStrokes
from midair.rig.takes.take import record_take
from midair.rig.takes.take_state import RecordSettings, TakeObserver

SETUP = StageSetup(
    heading="+x",
    start=(0.01, 0.02),
    contact=0.0,
    clear=0.01,
    approach=0.05,
    back=0.1,
    travel=((0.0, 0.2), (0.0, 0.1), (0.0, 0.05)),
)


class Ghost:
    """A stage without inertia, whose place is a formula of time."""

    def __init__(self, fails_at=None):
        self.at, self.went, self.moving, self.fails_at = (0.0, 0.0, 0.0), [], False, fails_at

    def ready(self, *, homing):
        return StageStamp(time=0.0, position=self.at, feed=0.0)

    def move(self, target, speed, *, stamp, stopped):
        begin, start = time.monotonic(), np.array(self.at)
        way = np.array(target) - start
        lasts = float(np.linalg.norm(way)) / speed
        self.went.append(target)
        self.moving = True
        try:
            while (part := (time.monotonic() - begin) / lasts if lasts else 1.0) < 1:
                self.at = tuple((start + part * way).tolist())
                stamp(StageStamp(time=begin + part * lasts, position=self.at, feed=speed))
                if stopped():
                    return None
                if self.fails_at is not None and self.at[0] > self.fails_at:
                    raise DeviceError("ghost: an alarm")
                time.sleep(0.02)
            self.at = target
        finally:
            self.moving = False
        return begin, time.monotonic()


class Watcher(TakeObserver):
    def __init__(self, kill_after=np.inf):
        self.events, self.end = [], time.monotonic() + kill_after

    def order(self):
        return "kill" if time.monotonic() > self.end else None

    def tell(self, event, drift=None):
        self.events.append(event)


def sensor(seconds=20.0):
    samples = np.random.default_rng(0).normal(size=(round(1000 * seconds), 4, 4))
    return WrappedSensor(ReplaySensor(Recording(samples=samples, rate=1000.0)), paced=True)


def drawn(path, stage, watcher=None, seconds=20.0):
    stage.at = SETUP.above
    with sensor(seconds) as opened:
        stroking = StageStrokes(stage, SETUP, length=0.05, speed=0.05)
        take = record_take(opened, RecordSettings(), watcher or Watcher(), stroking, path=path)
    return take, {step.stage: step.settings for step in open_take(path).recording.provenance.steps}


@pytest.mark.long
def test_the_stroke_is_in_the_file_when_it_was(tmp_path):
    watcher = Watcher()
    take, steps = drawn(tmp_path / "a.h5", Ghost(), watcher)
    assert take.end == "stroke"
    ((first, frames),) = steps["events"]["strokes"]
    assert [event.kind for event in watcher.events if event.kind == "stroke"] == ["stroke"]
    assert steps["stage"]["speed_m_s"][0] == pytest.approx(0.05, rel=0.02)
    table = np.array(steps["stage"]["stamps"])
    during = table[(table[:, 0] * 1000 >= first) & (table[:, 0] * 1000 <= first + frames)]
    # On the stroke, the place along x is a line through its beginning, at 50 mm/s.
    assert during[:, 1] == pytest.approx(0.01 + 0.05 * (during[:, 0] - first / 1000), abs=0.003)
    assert during[:, 3] == pytest.approx(0.0, abs=1e-3)
    # The last motion of the stage is within the recording.
    assert take.frames >= 1000 * table[-1, 0]


def test_a_sensor_that_ends_before_the_stroke_is_a_failure(tmp_path):
    stage = Ghost()
    take, _ = drawn(tmp_path / "a.h5", stage, seconds=0.6)
    assert (take.end, take.frames) == ("failure", 600)
    assert "ended early" in take.problem
    assert not stage.moving


def test_a_request_to_stop_needs_no_frame(tmp_path):
    """The sensor may be waiting for one for seconds."""
    stage, stop = Ghost(), threading.Event()
    stage.at = SETUP.above
    stroking = StageStrokes(stage, SETUP, length=0.05, speed=0.05)
    stroking.stopped = stop.is_set
    stroking.begin()
    time.sleep(0.3)
    stop.set()
    wait_until(lambda: not stage.moving, 10)
    assert stage.went == [(0.01, 0.02, 0.0)] or len(stage.went) == 2
    stroking.end()
    assert stroking.over


@pytest.mark.parametrize(("here", "first"), [((0.1, 0.05, 0.0), 0.01), ((0.1, 0.05, 0.04), 0.04)])
def test_the_way_to_the_start_goes_up_first_and_down_last(here, first):
    stage = Ghost()
    stage.at = here
    assert StageStrokes(stage, SETUP, length=0.05, speed=0.05).to_start(lambda: False)
    assert stage.went == [(*here[:2], first), (0.01, 0.02, first), (0.01, 0.02, 0.01)]
    stage.at = here
    assert not StageStrokes(stage, SETUP, length=0.05, speed=0.05).to_start(lambda: True)
