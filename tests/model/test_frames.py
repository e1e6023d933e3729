import numpy as np
import pytest

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.model import AmplitudeFrames, ControlGrid, PressureFrames, SensorGrid


def test_pressure_may_pull_and_keeps_its_sensor():
    sensor = SensorGrid(rows=2, columns=3)
    frames = PressureFrames(pressure=-np.ones((5, 2, 3)), rate=200.0, sensor=sensor)
    assert frames.frames == 5
    assert frames.time == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    assert frames.band is None
    assert not frames.pressure.flags.writeable


def test_a_cut_keeps_the_frames_of_its_time():
    frames = PressureFrames(pressure=np.arange(1000.0)[:, None, None] * np.ones((4, 4)), rate=1000.0)
    part = frames.cut(0.2, 0.3)
    assert part.pressure[[0, -1], 0, 0].tolist() == [200, 499]
    assert part.time[0] == 0
    assert part.provenance.steps[-1].settings == {"start_s": 0.2, "duration_s": 0.3}
    assert frames.cut(0.9).frames == 100
    assert frames.cut(0.9, 5.0).frames == 100
    assert frames.cut().frames == 1000


@pytest.mark.parametrize("part", [(1.0, None), (-0.1, 0.5), (0.5, 0.0), (0.5, -0.2)])
def test_a_cut_of_nothing_is_refused(part):
    with pytest.raises(InputError, match="a part of 0 to 1 s, got"):
        PressureFrames(pressure=np.zeros((1000, 4, 4)), rate=1000.0).cut(*part)


def test_amplitude_is_one_number_a_point():
    grid = ControlGrid(rows=2, columns=2)
    frames = AmplitudeFrames(amplitude=np.ones((3, 4)), rate=1000.0, grid=grid)
    assert (frames.frames, len(frames.time)) == (3, 3)


@pytest.mark.parametrize(
    ("pressure", "rate", "error", "says"),
    [
        (np.zeros((5, 4, 3)), 1.0, ShapeError, r"pressure: expected axes \(frame, 4, 4\), got shape \(5, 4, 3\)"),
        (np.zeros((0, 4, 4)), 1.0, ShapeError, "pressure"),
        (np.full((5, 4, 4), np.inf), 1.0, NonFiniteError, "pressure.*inf"),
        (np.zeros((5, 4, 4)), -1.0, InputError, "rate.*-1"),
    ],
)
def test_bad_pressure_is_refused(pressure, rate, error, says):
    with pytest.raises(error, match=says):
        PressureFrames(pressure=pressure, rate=rate)


@pytest.mark.parametrize(
    ("amplitude", "rate", "error", "says"),
    [
        (np.zeros((5, 255)), 1.0, ShapeError, "amplitude.*256"),
        (np.full((5, 256), -2.0), 1.0, InputError, "0 Pa or more, got -2 Pa"),
        (np.full((5, 256), np.nan), 1.0, NonFiniteError, "amplitude"),
        (np.zeros((5, 256)), 0.0, InputError, "rate"),
    ],
)
def test_bad_amplitude_is_refused(amplitude, rate, error, says):
    with pytest.raises(error, match=says):
        AmplitudeFrames(amplitude=amplitude, rate=rate)
