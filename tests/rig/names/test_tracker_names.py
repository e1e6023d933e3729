"""Trackers by name."""

import numpy as np
import pytest

import midair
from midair.errors import InputError, UnknownDeviceError
from midair.files import save_palm_path
from midair.model import PalmPath, TrackerPlacement


@pytest.fixture
def hand(tmp_path):
    times = np.arange(100) / 100
    palm = PalmPath(
        time=times,
        centre=np.column_stack([0.1 * times, 0 * times, 0.2 + 0 * times]),
        normal=np.tile([0, 0, -1.0], (100, 1)),
        fingers=np.tile([0, 1.0, 0], (100, 1)),
        confidence=np.ones(100),
    )
    save_palm_path(palm, tmp_path / "hand.csv")
    return tmp_path / "hand.csv"


def test_a_replayed_pose_arrives_after_its_latency_and_has_the_time_of_the_pose(hand):
    now = [50.0]
    placed = TrackerPlacement(offset=[0, 0, 0.05])
    with midair.open_tracker(f"replay:{hand}?latency_ms=20", placement=placed, clock=lambda: now[0]) as tracker:
        tracker.begin(60.0)
        now[0] = 60.0195
        assert tracker.newest() is None
        now[0] = 60.5205
        newest = tracker.newest()
        assert newest.time[0] == pytest.approx(60.5)
        np.testing.assert_allclose(newest.centre, [[0.05, 0, 0.25]])
        assert len(tracker.poses(since=60.405).time) == 10
        now[0] = 60.6
        assert tracker.status().age == pytest.approx(0.02)
        now[0] = 62.0
        assert tracker.status().state == "waiting"
        assert tracker.events() == []
    with midair.open_tracker(f"replay:{hand}", clock=lambda: now[0]) as tracker:
        now[0] += 9.0
        assert (tracker.status().poses, tracker.status().state) == (100, "waiting")


def test_replayed_poses_are_checked_as_live_ones(tmp_path):
    rows = np.array([[n / 100, 1e-4 * n, 0, 0.2, 0, 0, -1, 0, 1, 0, 1] for n in range(100)])
    rows[20:25, 1] += 1.0
    rows[60:, 1] = 0.006
    save_palm_path(PalmPath.from_rows(rows), tmp_path / "faulty.csv")
    now = [0.0]
    with midair.open_tracker(f"replay:{tmp_path / 'faulty.csv'}?freeze=0.1", clock=lambda: now[0]) as tracker:
        now[0] = 0.995
        status = tracker.status()
        assert (status.state, status.refused) == ("frozen", {"jump": 5, "frozen": 29})
        assert len(tracker.events()) == 2


def test_it_replays_in_real_time(hand):
    with midair.open_tracker(f"replay:{hand}") as tracker:
        assert tracker.wait(since=-np.inf, timeout=2.0)
        first = tracker.newest().time[0]
        assert tracker.wait(since=first, timeout=2.0)


@pytest.mark.parametrize(
    ("name", "error", "told"),
    [
        ("leapp:", UnknownDeviceError, "expected .*replay:PLACE"),
        ("replay:HAND?speed=-1", InputError, "option speed"),
        ("replay:HAND?pace=2", InputError, "expected the options .*latency_ms"),
    ],
)
def test_wrong_names_are_refused(hand, name, error, told):
    with pytest.raises(error, match=told):
        midair.open_tracker(name.replace("HAND", str(hand)))
