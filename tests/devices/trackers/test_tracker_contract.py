"""The contract of every live tracker over its real transport; to test a new one, add a sender to the table."""

import contextlib
import os
import socket
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from tests.simulators.leap_server import LeapServer, frame

import midair
from midair.errors import DeviceError
from midair.model import TrackerPlacement

os.environ.setdefault("LSLAPICFG", str(Path(__file__).parents[1] / "sensors" / "lsl_api.cfg"))
FLAT = (0, 0, -1, 0, 1, 0)


class Leap:
    def __init__(self):
        pytest.importorskip("websockets")
        self.server = LeapServer()
        self.name = f"leap:127.0.0.1:{self.server.port}"
        self.number = 0

    def ready(self):
        assert self.server.asked.wait(5)

    def send(self, values, stamp, confidence=1.0):
        self.number += 1
        self.server.send(frame(self.number, stamp + 1000, values, confidence))

    def junk(self):
        self.server.send("{")
        self.server.send('{"hands": [{"id": 7, "palmPosition": [1]}], "timestamp": 5}')

    def die(self):
        self.server.close()

    def revive(self):
        self.server = LeapServer(self.server.port)

    close = die


class Osc:
    def __init__(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.to = free.getsockname()
        self.name = f"osc:{self.to[1]}"
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.clock = datetime.now(UTC).timestamp() - time.monotonic()

    def ready(self):
        pass

    def send(self, values, stamp, confidence=1.0):
        from pythonosc.osc_bundle_builder import OscBundleBuilder
        from pythonosc.osc_message_builder import OscMessageBuilder

        message = OscMessageBuilder(address="/palm")
        for value in (*values, confidence):
            message.add_arg(float(value))
        bundle = OscBundleBuilder(stamp + self.clock)
        bundle.add_content(message.build())
        self.socket.sendto(bundle.build().dgram, self.to)

    def junk(self):
        self.socket.sendto(b"#bundle\0 and no more", self.to)
        self.socket.sendto(b"/palm\0\0\0,f\0\0\x3f\x80\0\0", self.to)

    die = revive = None

    def close(self):
        self.socket.close()


class Lsl:
    def __init__(self):
        self.pylsl = pytest.importorskip("pylsl")
        self.stream = f"palm {os.getpid()} {time.monotonic_ns()}"
        self.name = f"lsl:{self.stream}?search=60"
        self.revive()

    def revive(self):
        info = self.pylsl.StreamInfo(self.stream, "pose", 10, 0, self.pylsl.cf_double64, self.stream)
        self.outlet = self.pylsl.StreamOutlet(info)

    def ready(self):
        assert self.outlet.wait_for_consumers(10)

    def send(self, values, stamp, confidence=1.0):
        offset = self.pylsl.local_clock() - time.monotonic()
        self.outlet.push_sample([*map(float, values), confidence], stamp + offset)

    junk = None

    def die(self):
        self.outlet = None

    close = die


SENDERS = [Leap, Osc, pytest.param(Lsl, marks=pytest.mark.long)]


@pytest.fixture(params=SENDERS)
def sender(request):
    made = request.param()
    yield made
    made.close()


def eventually(holds, within=5.0):
    until = time.monotonic() + within
    while not holds():
        if time.monotonic() > until:
            return False
        time.sleep(2e-3)
    return True


class Hand:
    """Sends a palm that drifts, so that it never counts as frozen, every 10 ms of its own clock."""

    def __init__(self, sender, tracker):
        sender.ready()
        self.sender, self.tracker, self.count = sender, tracker, 0
        self.begun = time.monotonic()

    @property
    def stamp(self):
        return self.begun + 0.01 * self.count

    def good(self, number=1, **changes):
        for _ in range(number):
            self.count += 1
            # Stamps never run ahead by more than one pose.
            time.sleep(max(0.0, self.stamp - time.monotonic()))
            self.sender.send((1e-4 * self.count, 0.01, 0.2, *FLAT), self.stamp, **changes)

    def accepted(self):
        before = self.tracker.status().poses
        self.good()
        return eventually(lambda: self.tracker.status().poses == before + 1)

    def refused(self, kind, number):
        return eventually(lambda: self.tracker.status().refused.get(kind, 0) >= number)


def test_poses_arrive_in_array_coordinates_on_the_clock_of_this_computer(sender):
    turned = TrackerPlacement(rotation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]], offset=[0, 0, -0.05])
    with midair.open_tracker(sender.name, placement=turned) as tracker:
        assert tracker.newest() is None
        assert tracker.status().state == "waiting"
        hand = Hand(sender, tracker)
        hand.good(10)
        assert eventually(lambda: tracker.status().poses == 10)
        path = tracker.poses()
        np.testing.assert_allclose(path.centre[-1], [-0.01, 1e-3, 0.15], atol=1e-8)
        np.testing.assert_allclose(path.fingers[-1], [-1, 0, 0], atol=1e-7)
        np.testing.assert_allclose(np.diff(path.time)[5:], 0.01, atol=5e-3)
        assert 0 <= time.monotonic() - path.time[-1] < 0.5
        assert tracker.status().state == "tracking"
        assert len(tracker.poses(since=path.time[-3]).time) == 2
    assert tracker.status().state == "closed"


def test_faults_are_refused_counted_and_reported_once_and_good_poses_go_on(sender):
    with midair.open_tracker(sender.name) as tracker:
        hand = Hand(sender, tracker)
        hand.good(5)
        assert eventually(lambda: tracker.status().poses == 5)
        wrong = {"number": (np.nan, 0, 0.2, *FLAT), "range": (0, 0, 7.0, *FLAT), "jump": (1.0, 0, 0.2, *FLAT)}
        if sender.junk is not None:
            sender.junk()
            assert hand.refused("message", 2)
            assert hand.accepted()
        for kind, values in wrong.items():
            for _ in range(3):
                hand.count += 1
                sender.send(values, hand.stamp)
            assert hand.refused(kind, 3)
            assert hand.accepted(), kind
        sender.send((0, 0.01, 0.2, *FLAT), hand.stamp - 0.5)
        sender.send((0, 0.01, 0.2, *FLAT), hand.stamp + 3600)
        assert hand.refused("stamp", 2)
        assert hand.accepted()
        for small in range(1, 200):
            sender.send((1e-4 * hand.count, 0.01, 0.2, *FLAT), hand.stamp + small * 2e-6)
        assert hand.refused("flood", 190)
        assert hand.accepted()
        hand.good(confidence=0.1)
        assert hand.refused("confidence", 1)
        assert np.abs(tracker.poses().centre).max() < 0.21
        told = tracker.events()
        assert len(told) == len({line.split(":")[-1] for line in told}) <= 8
        assert all(line.startswith(sender.name) and "\n" not in line for line in told)


def test_a_frozen_pose_ends_the_poses_until_it_moves(sender):
    with midair.open_tracker(sender.name) as tracker:
        hand = Hand(sender, tracker)
        hand.good(3)
        for _ in range(25):
            hand.count += 1
            time.sleep(max(0.0, hand.stamp - time.monotonic()))
            sender.send((0.0, 0.01, 0.2, *FLAT), hand.stamp)
        assert hand.refused("frozen", 10)
        assert tracker.status().state == "frozen"
        assert tracker.status().age > 0.1
        assert hand.accepted()
        assert tracker.status().state == "tracking"


def test_a_hand_that_leaves_is_a_gap(sender):
    with midair.open_tracker(sender.name) as tracker:
        hand = Hand(sender, tracker)
        hand.good(3)
        assert eventually(lambda: (tracker.status().poses, tracker.status().state) == (3, "waiting"))
        hand.count += 20
        assert hand.accepted()
        assert tracker.status().state == "tracking"
        assert any("no pose for" in line for line in tracker.events())


@pytest.mark.long
def test_a_tracker_that_dies_is_lost_and_found_again(sender):
    if sender.die is None:
        pytest.skip("datagrams have no connection")
    with midair.open_tracker(sender.name) as tracker:
        Hand(sender, tracker).good(3)
        assert eventually(lambda: tracker.status().poses == 3)
        sender.die()
        assert eventually(lambda: tracker.status().state == "lost", 20)
        assert any("lost" in line for line in tracker.events())
        sender.revive()
        assert eventually(lambda: tracker.status().state != "lost", 70)
        hand = Hand(sender, tracker)
        hand.count += 1
        assert eventually(lambda: hand.good() or tracker.status().state == "tracking")


def test_a_tracker_that_is_not_there_is_one_line():
    pytest.importorskip("websockets")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(DeviceError, match=r"expected Ultraleap's tracking service at ws://127\.0\.0\.1:"):
        midair.open_tracker(f"leap:127.0.0.1:{port}")
    with contextlib.closing(Osc()) as taken, midair.open_tracker(taken.name):  # noqa: SIM117
        with pytest.raises(DeviceError, match="expected a free port"):
            midair.open_tracker(taken.name)
