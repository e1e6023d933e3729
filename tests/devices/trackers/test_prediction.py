import numpy as np
import pytest
from scipy.linalg import expm
from tests.palms import palm_path

from midair.devices import DAMPED_VELOCITY, MotionModel, PosePredictor
from midair.devices.trackers.tracker import ClockFit

# A decay time of 1000 s is none; larger ones lose digits to cancellation.
CONSTANT_VELOCITY = MotionModel(damping=1e3, memory=1e-4, agility=7.2e7)
CONSTANT_ACCELERATION = MotionModel(damping=1e4, memory=1e3, agility=5.0e4)
MODELS = [CONSTANT_VELOCITY, CONSTANT_ACCELERATION, DAMPED_VELOCITY]


def moving(times):
    return np.column_stack([0.2 * times, 0 * times, 0.2 + 0 * times])


@pytest.mark.parametrize("model", MODELS)
def test_the_transition_is_that_of_the_differential_equation(model):
    motion = np.array([[0, 1, 0], [0, -1 / model.damping, 1], [0, 0, -1 / model.memory]])
    for after in (0.002, 0.03):
        np.testing.assert_allclose(model.transition(after), expm(motion * after), rtol=1e-5, atol=1e-12)


def test_a_palm_of_constant_speed_is_predicted_and_by_damping_less_until_100_ms():
    times = np.arange(60) / 110
    for model in (CONSTANT_VELOCITY, CONSTANT_ACCELERATION):
        predictor = PosePredictor(model)
        predictor.add(palm_path(times, moving(times)))
        later = times[-1] + np.array([0.01, 0.04])
        np.testing.assert_allclose(predictor.at(later).centre, moving(later), atol=1e-5)
    predictor = PosePredictor(DAMPED_VELOCITY)
    predictor.add(palm_path(times, moving(times)))
    ahead = predictor.at(times[-1] + np.array([0.02, 0.1, 1.0])).centre[:, 0] - moving(times[-1:])[0, 0]
    assert 0.002 < ahead[0] < 0.004
    assert ahead[1] == ahead[2]


def test_a_late_program_asks_before_the_newest_pose_and_gets_the_palm_of_then():
    times = np.arange(100) / 100
    predictor = PosePredictor()
    predictor.add(palm_path(times, np.stack([5e-3 * np.sin(6.28 * times), 0 * times, 0.2 + 0 * times], axis=1)))
    late = times[-1] - np.array([0.1, 0.07, 0.01, 0.0])
    np.testing.assert_allclose(predictor.at(late).centre[:, 0], 5e-3 * np.sin(6.28 * late), atol=1.5e-3)


def test_a_correction_moves_position_and_velocity_without_a_step():
    times = np.arange(40) / 110
    predictor = PosePredictor(smoothing=0.02)
    predictor.add(palm_path(times, moving(times)))
    fine = times[-1] + np.arange(0, 0.02, 1e-4)
    before = predictor.at(fine[:100]).centre[:, 0]
    predictor.add(palm_path([times[-1] + 0.009], [[moving(times)[-1, 0] + 0.005, 0, 0.2]]))
    after = predictor.at(fine[100:]).centre[:, 0]
    speeds = np.diff(np.concatenate([before, after])) / 1e-4
    assert np.abs(np.diff(speeds[90:110])).max() < 0.02, "in m/s per 0.1 ms"
    assert abs(after[-1] - before[-1]) > 1e-3, "it does follow"


def test_after_a_gap_it_starts_again_from_the_new_pose():
    predictor = PosePredictor()
    predictor.add(palm_path([0.0, 0.01], moving(np.array([0.0, 0.01]))))
    predictor.at(np.array([0.02]))
    predictor.add(palm_path([0.5], [[0.05, 0.05, 0.25]]))
    np.testing.assert_allclose(predictor.at(np.array([0.51])).centre, [[0.05, 0.05, 0.25]])


@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4])
def test_a_clock_that_drifts_is_followed_below_delays_that_vary(drift):
    rng = np.random.default_rng(3)
    true = np.arange(0, 60, 1 / 110)
    stamps = 5000 + true * (1 + drift)
    fit, error = ClockFit(), []
    for at, stamp in zip(true, stamps, strict=True):
        fit.add(stamp, at + 2e-3 + rng.exponential(5e-3))
        error.append(fit.time(stamp) - at - 2e-3)
    settled = np.array(error[110 * 10 :])
    assert np.abs(settled).max() < 1e-3
    assert settled.std() < 3e-4


def test_stamps_of_the_clock_of_this_computer_stay():
    fit = ClockFit()
    for at in np.arange(100.0, 101, 0.01):
        fit.add(at - 0.03, at)
        assert fit.time(at - 0.03) == at - 0.03
