import numpy as np
import pytest

from midair.model import ControlGrid
from midair.solve import Live, Problem, relative_error
from midair.solve.lens import spreading_phase

pytest.importorskip("numba")


@pytest.fixture(scope="module")
def blob(transfer, channels_to_points, array, lossless):
    """A spot of 11 mm that moves 11 mm in 40 frames while its amplitude swings at 100 Hz, strength .1."""
    from midair.model import SensorGrid

    sensor, frame = SensorGrid(), np.arange(40)
    X, Y = np.meshgrid(sensor.x, sensor.y)
    x = (frame / 40 - 0.5) * 0.011
    shape = np.exp(-((X - x[:, None, None]) ** 2 + Y**2) / (2 * 0.011**2)).reshape(40, 16)
    channels = shape * (0.55 + 0.45 * np.sin(2 * np.pi * frame / 10))[:, None]
    psi = spreading_phase(ControlGrid(), array, lossless)
    return Problem(G=transfer, amplitude=0.1 * channels_to_points(channels), psi=psi)


def test_follows_a_moving_spot(blob):
    error = relative_error(blob, Live().solve(blob).phase)
    assert error[10:].mean() < 0.05
    assert error[10:].max() < 0.15


def test_more_time_a_frame_gives_less_error(blob):
    short, long = (
        relative_error(blob, Live(warm_iterations=field, warm_lift_iterations=lift).solve(blob).phase)[10:].mean()
        for field, lift in ((5, 3), (40, 20))
    )
    assert long < 0.5 * short


def test_frame_by_frame_is_the_same_as_all_at_once(blob):
    follower = Live().begin(blob)
    np.testing.assert_array_equal(np.stack([follower.follow(p) for p in blob.amplitude]), Live().solve(blob).phase)


def test_silence_moves_nothing(blob):
    follower = Live().begin(blob)
    before = follower.follow(blob.amplitude[0])
    np.testing.assert_array_equal(follower.follow(np.zeros(256)), before)


def test_first_frames_get_the_iterations_of_first_frames(blob):
    made = Live(iterations=30, warm_iterations=3).solve(blob).iterations
    assert list(made[:3]) == [30, 3, 3]
