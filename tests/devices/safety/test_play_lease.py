import multiprocessing
import time

import numpy as np
import pytest
from tests.waiting import Clock, wait_until

from midair.devices import PlayLease, VirtualArray, check_exposure, under_lease
from midair.errors import DeviceStateError, InputError, StoppedError
from midair.model import Drive, TransducerArray
from midair.rig import default_exposure


@pytest.fixture
def clock():
    return Clock(100.0)


@pytest.fixture
def permit(clock):
    return PlayLease(clock)


def test_nothing_may_sound_before_it_is_armed(permit):
    assert not permit.armed
    assert permit.level == 0
    assert not permit.renew()


def test_an_arming_lasts_until_its_deadline_and_each_renewal_moves_that(permit, clock):
    leave = permit.arm(lasts=0.5)
    clock.now += 0.4
    assert permit.refusal(leave) is None
    assert permit.renew(lasts=0.5)
    clock.now += 0.4
    assert permit.refusal(leave) is None
    assert permit.left == pytest.approx(0.1)
    clock.now += 0.11
    assert permit.refusal(leave) == "expired"


def test_a_missed_deadline_cannot_be_renewed(permit, clock):
    leave = permit.arm()
    clock.now += 0.6
    assert not permit.renew()
    assert permit.refusal(leave) == "disarmed"
    clock.now -= 0.3
    assert permit.refusal(leave) == "disarmed"


def test_a_stop_ends_every_arming_before_it_and_no_later_one(permit):
    first = permit.arm()
    permit.stop()
    assert permit.refusal(first) == "stopped"
    assert not permit.renew()
    second = permit.arm()
    assert permit.refusal(second) is None
    assert permit.refusal(first) == "stopped"


def test_a_newer_arming_ends_an_older_one(permit):
    first = permit.arm()
    second = permit.arm()
    assert permit.refusal(first) == "disarmed"
    assert permit.refusal(second) is None


def test_the_level_can_be_lowered_and_never_raised_beyond_what_was_armed(permit):
    permit.arm(0.5)
    permit.turn(0.2)
    assert permit.level == 0.2
    permit.turn(0.5)
    with pytest.raises(InputError, match="at most"):
        permit.turn(0.6)
    permit.disarm()
    assert permit.level == 0


def player(permit, leave, pipe):
    """Run in another process: read the lease, and try what only the holder may do."""
    pipe.send((permit.refusal(leave), permit.level))
    try:
        permit.renew()
    except DeviceStateError as wrong:
        pipe.send(str(wrong))
    permit.stop()
    pipe.recv()
    while permit.armed:
        time.sleep(0.001)
    pipe.send(permit.refusal(leave))


@pytest.mark.long
def test_another_process_reads_the_lease_and_can_only_stop_it():
    permit = PlayLease()
    leave = permit.arm(0.75, lasts=10)
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=player, args=(permit, leave, there))
    process.start()
    try:
        assert here.recv() == (None, 0.75)
        assert "the player, which can only stop" in here.recv()
        here.send("go on")
        assert here.recv() == "stopped"
        assert permit.refusal(leave) == "stopped"
        # Stops of both ends at once are two: none can undo the other.
        again = permit.arm()
        permit.stop()
        assert permit.stops == 2
        assert permit.refusal(again) == "stopped"
    finally:
        process.join(10)
        assert process.exitcode == 0


@pytest.fixture
def small_drive():
    array = TransducerArray.autd3(columns=1, rows=1)
    return Drive(array=array, phase=np.zeros((3500, array.count), np.float32), level=np.full(3500, 0.01), rate=1000.0)


@pytest.mark.long
def test_an_array_checks_the_lease_before_every_frame(permit, small_drive):
    leave = permit.arm(lasts=10)
    array = VirtualArray(small_drive.array)
    seen = []

    def progress(done, total):
        seen.append(done)
        if len(seen) == 2:
            permit.stop()

    with array, pytest.raises(StoppedError, match="stopped on request"), under_lease(array, permit, leave):
        array.play(check_exposure(small_drive, array, default_exposure()), progress=progress)
    assert len(seen) == 2
    assert not array.emitting


def test_a_thread_silences_the_array_between_its_own_checks(permit, clock):
    leave = permit.arm()
    silenced = []

    class Array:
        name = "array"
        check = None

        def allowing(self, check):
            self.check = check

        def silence(self):
            silenced.append(time.monotonic())

    array = Array()
    with under_lease(array, permit, leave, every=0.001):
        array.check()
        clock.now += 0.5
        wait_until(lambda: silenced, 5)
        with pytest.raises(StoppedError, match="did not renew its permission"):
            array.check()
    assert len(silenced) == 1
    assert array.check is None
