import numpy as np
import pytest

from midair.flow import Settings, at_rate, felt, reproduce
from midair.model import ControlGrid, PressureFrames, Provenance, Recording, TransducerArray
from midair.physics import focus_amplitude

SMALL = TransducerArray.autd3(columns=1, rows=1)


def recording(frequency=100.0, rate=1000.0):
    time = np.arange(500) / rate
    samples = np.zeros((500, 4, 4))
    samples[:, 1, 2] = 30 * np.sin(2 * np.pi * frequency * time)
    return Recording(samples=samples, rate=rate, unit="Pa", provenance=Provenance(source="test"))


def test_the_pages_of_the_paper_in_order():
    settings = Settings(iterations=3)
    pressure = felt(recording(), None, settings).cut(0.1, 0.02)
    made = reproduce(pressure, SMALL, settings)
    stages = [step.stage for step in made.solution.drive.provenance.steps]
    assert stages == ["calibrate", "cut", "prepare", "solve"]
    assert made.target.frames == made.solution.drive.frames == 20
    assert made.strength(settings) == pytest.approx(made.target.amplitude.max() / focus_amplitude(ControlGrid(), SMALL))


def test_another_rate_keeps_the_wave():
    pressure = at_rate(felt(recording(), None, Settings()), 2000.0)
    assert pressure.rate == 2000
    assert pressure.frames == 1000
    middle = pressure.pressure[300:700, 1, 2]
    time = np.arange(300, 700) / 2000
    np.testing.assert_allclose(middle, 30 * np.sin(2 * np.pi * 100 * time), atol=0.4)
    assert pressure.provenance.steps[-1].stage == "resample"


def test_the_same_rate_is_left_alone():
    pressure = PressureFrames(pressure=np.ones((3, 4, 4)), rate=1000.0)
    assert at_rate(pressure, 1000.0) is pressure


def test_progress_reaches_the_end():
    seen = []
    pressure = felt(recording(), None, Settings()).cut(0.1, 0.01)
    reproduce(pressure, SMALL, Settings(iterations=1), progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (10, 10)
