"""What a session states of the air of the room before it plays a drive."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from midair.devices import ExposureChoices
from midair.evaluate import error_at_temperature
from midair.files import profile_named
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.rig import OpenRig, PlayObserver, PlaySettings, Session, VirtualRig, session
from midair.solvers import solve

ARRAY = TransducerArray.autd3(columns=1, rows=1)
OWN = Medium.at(temperature=22.0, humidity=0.5)


@pytest.fixture(scope="module")
def target():
    amplitude = 300.0 * np.random.default_rng(0).random((5, 36))
    return AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=ControlGrid(rows=6, columns=6, pitch=11e-3))


@pytest.fixture(scope="module")
def drive(target):
    return solve(target, ARRAY, method="fast", acoustics=Acoustics(medium=OWN)).drive


@pytest.fixture
def stated(monkeypatch):
    """The line on a drive and a room, and whether it warns; without a target the test fails where one is read."""

    def line(drive, room, *targets, gated=True):
        monkeypatch.setattr(session, "load_target", lambda *_, **__: targets[0])
        lines = []

        class Observer(PlayObserver):
            def note(self, text, *, warns=False):
                lines.append((text, warns))

        array = VirtualRig(array=ARRAY).array_device()
        array.gated = gated
        settings = PlaySettings(exposure=ExposureChoices(profile=profile_named("occupational-110"), room=room))
        rig = OpenRig(array=array, sensor=None, settings=settings)
        assert Session(rig=rig, observer=Observer()).in_air(drive, settings, Path("a.drive.h5")) is drive
        return lines[0]

    return line


def test_an_unknown_room_temperature_is_reported_and_not_guessed(drive, stated, target):
    said, warns = stated(drive, None)
    assert warns
    assert "room temperature unknown: the drive was solved for 22 °C, 50 % humidity" in said
    assert stated(drive, None, gated=False) == ("air: 22 °C, 50 % humidity, the drive's own", False)
    # The paper's air is that of 14 °C.
    old = replace(drive, acoustics=Acoustics())
    assert not stated(old, Medium.at(temperature=14.0))[1]
    assert "solved for 340 m/s (14 °C): E " in stated(old, OWN, target)[0]


def test_more_than_two_degrees_are_reported_with_the_error(drive, target, stated):
    for near in [20.0, 24.0]:
        said, warns = stated(drive, Medium.at(temperature=near))
        assert (warns, f"the room has {near:g} °C" in said) == (False, True)
    for far in [19.9, 24.1, 30.0]:
        room = Medium.at(temperature=far)
        said, warns = stated(drive, room, target)
        assert warns
        here, own, frames = re.search(r"E ([\d.]+) % instead of ([\d.]+) %, the mean of (\d+) frames", said).groups()
        assert float(here) == pytest.approx(100 * error_at_temperature(drive, target, room).mean(), abs=0.05)
        assert float(own) == pytest.approx(100 * error_at_temperature(drive, target, OWN).mean(), abs=0.05)
        assert int(frames) == 5
    assert "the file has no target" in stated(drive, room, None)[0]
    silent = replace(target, amplitude=np.zeros((5, 36)))
    assert "the drive is silent" in stated(drive, room, silent)[0]
