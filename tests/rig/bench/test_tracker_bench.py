"""Calibration of a tracker with a simulated hand that goes to the marked places."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from midair.cli.app import run
from midair.cli.commands.calibrate import measure_array as command
from midair.devices import ExposureChoices, RawPose, Tracker
from midair.devices.trackers.tracker import TrackerOptions
from midair.errors import DeviceError
from midair.files import load_tracker, profile_named
from midair.rig import PLACES, VirtualRig, calibrate_tracker

EXPOSURE = ExposureChoices(profile=profile_named("occupational-110"))
TURN = Rotation.from_euler("xyz", [0, 5, 175], degrees=True).as_matrix()
OFFSET = np.array([0.0, -0.1, 0.01])


class Hand:
    """A source whose palm lies at a place, with the noise of a tracker; the clock runs with the calls."""

    host_clock = True

    def __init__(self, off=1.5e-3, noise=3e-4):
        self.rng, self.off, self.noise = np.random.default_rng(2), off, noise
        self.now, self.sent = 100.0, 100.0
        self.go(0)

    def clock(self):
        return self.now

    def go(self, at):
        self.place = (PLACES[at] + self.rng.normal(0, self.off, 3) - OFFSET) @ TURN

    def open(self):
        pass

    close = open

    def pull(self, wait):
        self.now += 1.0
        times = np.arange(self.sent + 0.01, self.now, 0.01)
        self.sent = self.now
        centre = self.place + self.rng.normal(0, self.noise, (len(times), 3))
        return [RawPose(stamp=at, values=[*c, 0, 0, -1, 0, 1, 0]) for at, c in zip(times, centre, strict=True)]


class Options(TrackerOptions):
    def source(self, place):
        raise NotImplementedError


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.setattr("midair.rig.bench.array_bench.ROUNDS", 3)
    monkeypatch.setattr("midair.rig.bench.array_bench.ROUND", 0.005)
    rig = VirtualRig()
    with rig.array_device(rig.skin()) as array:

        def run(hand, **more):
            with Tracker(hand, name="hand", options=Options(), clock=hand.clock) as tracker:
                return calibrate_tracker(tracker, array, exposure=EXPOSURE, say=hand.go, **more)

        yield run


@pytest.mark.long
def test_the_command_writes_the_placement_of_a_hand_that_goes_where_it_says(bench, monkeypatch, tmp_path, capsys):
    hand, path = Hand(), str(tmp_path / "palm.toml")
    made = Tracker(hand, name="hand", options=Options(), clock=hand.clock)
    monkeypatch.setattr(command, "open_tracker", lambda _: made)
    monkeypatch.setattr(command, "print_note", lambda text: hand.go(int(text.split()[1]) - 1))
    assert run(["calibrate", "tracker", "leap:", path]) == 0
    out, err = capsys.readouterr()
    assert "(k = 2)" in out
    assert "SIMULATED" in out + err
    found = load_tracker(path)
    error = found.points((PLACES - OFFSET) @ TURN) - PLACES
    assert np.abs(error).max() < 4e-3
    assert 2e-4 < found.uncertainty < 3e-3
    assert np.sqrt((error**2).mean()) < 3 * found.uncertainty


@pytest.mark.long
def test_a_hand_that_moves_is_no_place_unless_it_is_confirmed(bench):
    with pytest.raises(DeviceError, match=r"held still at place 1 .* tracker is"):
        bench(Hand(noise=4e-3))
    assert bench(Hand(noise=4e-3), entered=lambda: True).uncertainty < 5e-3
