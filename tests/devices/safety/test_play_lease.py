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
def lease(clock):
    return PlayLease(clock)


def test_an_arming_lasts_until_its_deadline_which_a_renewal_moves_and_not_when_it_is_missed(lease, clock):
    assert (lease.armed, lease.level, lease.renew()) == (False, 0, False), "nothing may sound before"
    token = lease.arm(lasts=0.5)
    clock.now += 0.4
    assert lease.refusal(token) is None
    assert lease.renew(lasts=0.5)
    clock.now += 0.4
    assert lease.refusal(token) is None
    assert lease.left == pytest.approx(0.1)
    clock.now += 0.11
    assert lease.refusal(token) == "expired"
    token = lease.arm()
    clock.now += 0.6
    assert not lease.renew()
    assert lease.refusal(token) == "disarmed"
    clock.now -= 0.3
    assert lease.refusal(token) == "disarmed"


def test_a_stop_or_a_newer_arming_ends_every_arming_before_it_and_no_later_one(lease):
    first = lease.arm()
    lease.stop()
    assert lease.refusal(first) == "stopped"
    assert not lease.renew()
    second = lease.arm()
    assert lease.refusal(second) is None
    assert lease.refusal(first) == "stopped"
    third = lease.arm()
    assert lease.refusal(second) == "disarmed"
    assert lease.refusal(third) is None


def test_the_level_can_be_lowered_and_never_raised_beyond_what_was_armed(lease):
    lease.arm(0.5)
    lease.turn(0.2)
    assert lease.level == 0.2
    lease.turn(0.5)
    with pytest.raises(InputError, match="at most"):
        lease.turn(0.6)
    lease.disarm()
    assert lease.level == 0


def player(lease, token, pipe):
    """Run in another process: read the lease, and try what only the holder may do."""
    pipe.send((lease.refusal(token), lease.level))
    try:
        lease.renew()
    except DeviceStateError as wrong:
        pipe.send(str(wrong))
    lease.stop()
    pipe.recv()
    while lease.armed:
        time.sleep(0.001)
    pipe.send(lease.refusal(token))


@pytest.mark.long
def test_another_process_reads_the_lease_and_can_only_stop_it():
    lease = PlayLease()
    token = lease.arm(0.75, lasts=10)
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=player, args=(lease, token, there))
    process.start()
    try:
        assert here.recv() == (None, 0.75)
        assert "the player, which can only stop" in here.recv()
        here.send("go on")
        assert here.recv() == "stopped"
        assert lease.refusal(token) == "stopped"
        # Stops of both ends at once are two: none can undo the other.
        again = lease.arm()
        lease.stop()
        assert lease.stops == 2
        assert lease.refusal(again) == "stopped"
    finally:
        process.join(10)
        assert process.exitcode == 0


@pytest.fixture
def small_drive():
    array = TransducerArray.autd3(columns=1, rows=1)
    return Drive(array=array, phase=np.zeros((3500, array.count), np.float32), level=np.full(3500, 0.01), rate=1000.0)


@pytest.mark.long
def test_an_array_checks_the_lease_before_every_frame(lease, small_drive):
    token = lease.arm(lasts=10)
    array = VirtualArray(small_drive.array)
    seen = []

    def progress(done, total):
        seen.append(done)
        if len(seen) == 2:
            lease.stop()

    with array, pytest.raises(StoppedError, match="stopped on request"), under_lease(array, lease, token):
        array.play(check_exposure(small_drive, array, default_exposure()), progress=progress)
    assert len(seen) == 2
    assert not array.emitting


def test_a_thread_silences_the_array_between_its_own_checks(lease, clock):
    token = lease.arm()
    silenced = []

    class Array:
        name = "array"
        check = None

        def allowing(self, check):
            self.check = check

        def silence(self):
            silenced.append(time.monotonic())

    array = Array()
    with under_lease(array, lease, token, every=0.001):
        array.check()
        clock.now += 0.5
        wait_until(lambda: silenced, 5)
        with pytest.raises(StoppedError, match="did not renew its permission"):
            array.check()
    assert len(silenced) == 1
    assert array.check is None
