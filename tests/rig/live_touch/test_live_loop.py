"""The live loop with a scripted source and with virtual units whose frames can be inspected."""

import time
from dataclasses import replace

import numpy as np
import pytest

from midair.devices import (
    Chunk,
    ExposureChoices,
    Source,
    Stream,
    StreamedSensor,
    VirtualUnits,
    check_exposure_level,
    virtual_immediate,
)
from midair.errors import DeviceError, SilentFramesError, StoppedError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import ControlGrid, Placement
from midair.rig.live_touch.live_loop import LiveLoop
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.touch import Touch
from midair.rig.live_touch.touch_ring import FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED, TouchRing

# The loop keeps to the clock of this machine, which a busy one does not.
pytestmark = [pytest.mark.long, pytest.mark.usefixtures("live_kernel")]

ONE = Placement.grid(columns=1, rows=1)
SMALL = ControlGrid(rows=4, columns=4, pitch=11e-3)


class Script(Source):
    """Frames of 10 Pa on every cell: (number, s from the start, by how much the stamp says earlier) each."""

    def __init__(self, frames, *, dies=None):
        self._frames, self._dies = frames, dies

    def open(self):
        return Stream(channels=16, rate=1000.0, unit="Pa")

    def start(self):
        self._begin, self._left = time.monotonic(), list(self._frames)

    def pull(self, wait):
        now = time.monotonic() - self._begin
        if self._dies is not None and now > self._dies:
            raise DeviceError("script: expected a cable, it was pulled")
        if not self._left or now + wait < self._left[0][1]:
            time.sleep(min(wait, 2e-3))
            return None
        number, due, early = self._left.pop(0)
        time.sleep(max(0.0, due - now))
        return Chunk(
            samples=np.full((1, 16), 10.0), first=number, device_time=number / 1000, host_time=self._begin + due - early
        )

    def describe(self):
        return {}


def steady(count, first=0, begin=0.02):
    return [(number, begin + number / 1000, 0.0) for number in range(first, first + count)]


def ran(script, *, duration=None, check=lambda: None, level=lambda: 1.0, units=None, latency=None, **pace):
    """(slots of the ring, ring, frames that the units got) of a run."""
    units = units or VirtualUnits(kept=10_000)
    array = virtual_immediate(ONE, units=units)
    ring = TouchRing(4096, 16, 249)
    sensor = StreamedSensor(script, name="script")
    problem = None
    with sensor, array:
        choices = ExposureChoices(profile=profile_named(DEFAULT_PROFILE))
        clearance = check_exposure_level(0.5, array, choices, rate=1000.0)
        touch = Touch(LiveSettings(latency=latency), None, sensor.grid, 1000.0, array.array, 0.5, grid=SMALL)
        loop = LiveLoop(
            sensor,
            touch,
            array,
            ring,
            pace=replace(touch.schedule, **({"hold": 0.1, "rise": 0.0, "ahead": np.inf} | pace)),
            strongest=clearance.strongest,
            level=level,
            check=check,
        )
        try:
            with array.frames_to_come(clearance) as put:
                sensor.start()
                loop.run(put, duration)
        except DeviceError as wrong:
            problem = wrong
        finally:
            sensor.stop()
    return ring.since(0)[0], ring, list(units.frames), problem


@pytest.mark.parametrize(("latency", "taken", "formed"), [(None, 60, 60), (0.2, 160, 320)])
def test_every_frame_sounds_a_hold_after_it_was_taken_in_order(latency, taken, formed):
    """With a latency there are two frames for each that was taken, the bias of the first after 90 ms, and they wait."""
    slots, ring, frames, _ = ran(Script(steady(taken)), duration=taken / 1000, latency=latency, ahead=0.07)
    assert slots["number"].tolist() == list(range(formed))
    assert (slots["instant"] - slots["left"])[slots["left"] > 0].max() <= 70_000_000
    on_time = slots[slots["flags"] == FRAME_EMITTED]
    assert len(on_time) > 40
    assert np.abs(on_time["instant"] * 1e-9 - on_time["taken"] - 0.1).max() < 5e-3
    instants = [instant for _, intensity, instant in frames if intensity]
    assert np.all(np.diff(instants) > 0)
    silent = int((slots["flags"] == 0).sum())
    assert ring.count("played") + ring.count("late") + silent == formed
    assert max(intensity for _, intensity, _ in frames) == 127


def test_frames_that_never_came_are_held_and_counted():
    script = Script([*steady(20), *steady(20, first=25)])
    slots, ring, _, _ = ran(script, duration=0.045)
    assert slots["number"].tolist() == list(range(45))
    assert np.flatnonzero(slots["flags"] & FRAME_REPEATED).tolist() == list(range(20, 25))
    assert ring.count("lost") == 5
    assert (slots["samples"][20:25] == 10.0).all()


def test_a_frame_past_its_instant_is_not_played():
    """Stamps say that all were taken 150 ms before they came, and the hold is 100 ms."""
    slots, ring, played, _ = ran(Script([(number, due, 0.15) for number, due, _ in steady(30)]), duration=0.03)
    assert (slots["flags"] == FRAME_LATE).all()
    assert ring.count("late") == 30
    assert not any(intensity for _, intensity, _ in played)


def test_without_frames_it_fades_and_rises_again():
    """A gap of 150 ms; quiet is longer than usual, since a busy machine holds this process up for 20 ms and more."""
    script = Script([*steady(100), *steady(60, first=250)])
    slots, ring, frames, _ = ran(script, duration=0.31, rise=0.05, quiet=0.08)
    assert ring.count("gaps") == 1
    silent = [instant for _, intensity, instant in frames if not intensity]
    last = slots["instant"][99]
    faded = min(instant for instant in silent if instant > last)
    assert (faded - last) * 1e-9 < 0.15
    again = slots["intensity"][250:310].astype(int)
    assert again[0] < 20
    assert again.max() == 127
    assert (np.diff(again[slots["flags"][250:310] == FRAME_EMITTED]) >= 0).all()


class Failsafe(VirtualUnits):
    """Units whose failsafe acts before some of the frames that are put; they are silent until it is released."""

    def __init__(self, acts):
        super().__init__(kept=10_000)
        self._acts, self._put, self._active = set(acts), 0, False

    def put(self, phases, intensity, instant):
        self._put += 1
        if self._put in self._acts:
            self._counts["failsafe"] += 1
            self._active = True
        if self._active:
            raise SilentFramesError("units: the failsafe acted")
        super().put(phases, intensity, instant)

    def release(self):
        self._active = False


@pytest.mark.parametrize("how", [{}, {"latency": 0.2, "ahead": 0.07}])
def test_a_run_continues_after_the_failsafe_and_the_level_rises_again(how):
    """Also if louder frames were waiting to be sent."""
    units = Failsafe([100 if not how else 300])
    slots, ring, frames, problem = ran(Script(steady(250)), duration=0.25, units=units, rise=0.05, quiet=1.0, **how)
    assert problem is None
    sent = np.array([intensity for _, intensity, _ in frames], int)
    assert np.diff(sent[sent.argmax() :]).max() < 20
    assert ring.count("failsafe") == 1
    level = slots["intensity"][(slots["flags"] & FRAME_LATE) == 0].astype(int)
    (last,) = np.flatnonzero(np.diff(level) < 0)
    assert level[last] == level[-1] == 127
    assert level[last + 1 : last + 4].max() < 20


def test_a_failsafe_that_acts_again_and_again_ends_the_run():
    units = Failsafe(range(20, 200, 10))
    _, _, _, problem = ran(Script(steady(300)), duration=0.3, units=units, rise=0.05, trips=3)
    assert isinstance(problem, SilentFramesError)
    assert units.counts()["failsafe"] == 4


def test_the_level_is_turned_down_at_once():
    moments = []

    def level():
        moments.append(0)
        return 1.0 if len(moments) < 30 else 0.25

    slots, _, _, _ = ran(Script(steady(60)), duration=0.06, level=level)
    loud = slots["intensity"][slots["flags"] == FRAME_EMITTED]
    assert set(loud.tolist()) == {127, 31}


def test_a_sensor_that_is_lost_ends_in_silence():
    _, _, frames, problem = ran(Script(steady(30), dies=0.06))
    assert "pulled" in str(problem)
    assert frames[-1][1] == 0


def test_a_permit_that_is_gone_ends_in_silence_while_frames_come():
    began = []

    def check():
        began.append(time.monotonic())
        if began[-1] - began[0] > 0.3:
            raise StoppedError("virtual: expired")

    _, _, frames, problem = ran(Script(steady(2000)), check=check)
    assert isinstance(problem, StoppedError)
    assert frames[-1][1] == 0


def test_late_and_lost_frames_are_counted_in_time_and_the_rate_is_measured():
    """A sensor of 900 Hz that states 1000 and loses its frames 20 to 24."""
    frames = [(number, 0.02 + number / 900, 0.0) for number in range(100) if not 20 <= number < 25]
    _, ring, _, _ = ran(Script(frames), duration=0.1)
    found = ring.over_time(0.1)
    assert (sum(found["late"]), sum(found["lost"])) == (ring.count("late"), 5)
    assert ring.count("timed") == 99
    assert ring.count("timed") / ring.count("span_us") == pytest.approx(900e-6, rel=1e-3)
