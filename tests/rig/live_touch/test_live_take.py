import threading
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from midair.devices import ExposureChoices
from midair.files import DEFAULT_PROFILE, load_played, open_take, profile_named, save
from midair.model import Calibration, Placement, SensorGrid
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.live_take import LiveTake
from midair.rig.live_touch.process import LoopStarted
from midair.rig.live_touch.touch import Rehearsal
from midair.rig.live_touch.touch_ring import FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED, TouchRing

SENSOR, ONE = SensorGrid(rows=2, columns=2), Placement.grid(columns=1, rows=1)
ORDER = LiveSettings(
    sensor="lsl:Skin", device="virtual", exposure=ExposureChoices(profile=profile_named(DEFAULT_PROFILE)), placement=ONE
)
FOUND = LoopStarted(
    sensor=SENSOR,
    unit="V",
    rate=1000.0,
    schedule=ORDER.schedule(1000.0),
    calibration=Calibration.flat(SENSOR, sensitivity=0.1),
    simulated=True,
    transducers=249,
    exposure="kept",
    level=0.5,
    strongest=127,
    granted="real-time priority, memory locked",
    rehearsal=Rehearsal(frames=400, late=0, longest=0.001),
    delay=0.006,
    parts=((20.0, 470.0),),
    error=(0.1,),
    silencer="off",
    array_calibration="",
)


def fill(ring, first, count, flags=FRAME_EMITTED):
    for number in range(first, first + count):
        slot = ring.next_slot()
        slot["number"], slot["samples"][:4], slot["phases"] = number, number, number % 256
        slot["flags"], slot["intensity"], slot["instant"] = flags, 100, 10**9 + number
        ring.publish()


@contextmanager
def taking(path, ring, order=ORDER):
    """A take of what the block puts into the ring, or has put there; it is closed afterwards."""
    found = replace(FOUND, schedule=order.schedule(1000.0))
    take = LiveTake(path, order, found, ring.since, {"object": "towel"}, every=0.005)
    thread = threading.Thread(target=take.run)
    thread.start()
    yield take
    take.end()
    thread.join()
    take.close()


def test_the_take_holds_samples_and_emitted_phases_of_each_frame(tmp_path):
    ring = TouchRing(4096, 64, 249)
    with taking(tmp_path / "felt.h5", ring) as take:
        fill(ring, 0, 500)
        fill(ring, 500, 3, FRAME_REPEATED)
        fill(ring, 503, 600)
        fill(ring, 1103, 100, FRAME_LATE)
    save(open_take(tmp_path / "felt.h5").recording, tmp_path / "felt.h5")  # keeps all that the file holds besides
    kept, played = open_take(tmp_path / "felt.h5"), load_played(tmp_path / "felt.h5")
    assert (kept.recording.samples == np.arange(1203)[:, None, None]).all()
    assert (played.phase_steps == (np.arange(1203) % 256)[:, None]).all()
    assert np.flatnonzero(played.state & FRAME_REPEATED).tolist() == [500, 501, 502]
    # Frames that are late in a row are one event, or several if they were read at different times.
    found = [(event.kind, frame) for event in kept.journal for frame in range(event.frame, event.frame + event.frames)]
    assert found == [*(("lost", 500 + n) for n in range(3)), *(("late", 1103 + n) for n in range(100))]
    (events,) = [each for each in kept.recording.provenance.steps if each.stage == "events"]
    assert (events.settings["late_frames"], events.settings["lost_frames"]) == (100, 3)
    assert kept.calibration is not None
    assert kept.recording.provenance.notes == {"object": "towel"}
    (step, *_) = [each for each in kept.recording.provenance.steps if each.stage == "live"]
    assert (step.settings["hold_s"], step.settings["level"]) == (0.006, 0.5)
    assert take.missed == 0


def test_with_a_latency_the_take_holds_two_frames_for_each_sample(tmp_path):
    ring = TouchRing(4096, 64, 249)
    with taking(tmp_path / "felt.h5", ring, ORDER.but(latency=0.2)):
        fill(ring, 0, 301)
        fill(ring, 301, 100, FRAME_LATE)
    kept, played = open_take(tmp_path / "felt.h5"), load_played(tmp_path / "felt.h5")
    assert (kept.recording.samples == 2 * np.arange(200)[:, None, None]).all()
    assert (played.rate, played.frames, played.state.tolist()) == (2000.0, 400, [1] * 301 + [2] * 99)
    assert (played.phase_steps == (np.arange(400) % 256)[:, None]).all()


@pytest.mark.long
def test_frames_not_read_in_time_are_counted(tmp_path):
    ring = TouchRing(64, 64, 249)
    fill(ring, 0, 200)
    with taking(tmp_path / "felt.h5", ring) as take:
        pass
    kept = open_take(tmp_path / "felt.h5")
    assert take.missed == 137
    assert [(event.kind, event.frame, event.frames) for event in kept.journal] == [("lost", 0, 137)]
    assert kept.recording.frames == 63
