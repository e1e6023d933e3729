import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.correct import IterativeCorrection, Response, measured_response
from midair.dsp import band_window, filter_response
from midair.errors import InputError, ShapeError

RATE, BAND = 1000.0, (20.0, 470.0)


def noise(seed=0, frames=2000):
    x = np.random.default_rng(seed).standard_normal((frames, 2, 2))
    return in_band(x)


def in_band(x):
    return filter_response(x, RATE, lambda f: band_window(f, BAND, edges=(10.0, 20.0)).reshape(-1, 1, 1), reach=0.2)


def chain(x, corner=150.0):
    """A first-order low-pass and a gain of .7, as a model of a re-recording."""
    return filter_response(x, RATE, lambda f: (0.7 / (1 + 1j * f / corner)).reshape(-1, 1, 1), reach=0.2)


def test_the_response_of_a_known_filter():
    found = measured_response(noise(), chain(noise()), RATE, band=BAND)
    frequency = np.array([60.0, 150.0, 400.0])
    assert found.at(frequency) == pytest.approx(0.7 / (1 + 1j * frequency / 150), abs=0.03)


def test_where_nothing_was_asked_the_nearest_answer_counts():
    time = np.arange(2000) / RATE
    tone = np.sin(2 * np.pi * 100 * time)[:, None, None] * np.ones((1, 2, 2))
    found = measured_response(tone, 0.5 * tone, RATE, band=BAND)
    assert np.abs(found.value) == pytest.approx(np.full(len(found.value), 0.5), abs=0.01)


def test_nothing_asked_and_other_shapes_are_refused():
    with pytest.raises(InputError, match="got none"):
        measured_response(np.zeros((200, 2, 2)), np.ones((200, 2, 2)), RATE, band=BAND)
    with pytest.raises(ShapeError):
        measured_response(np.ones((200, 2, 2)), np.ones((100, 2, 2)), RATE, band=BAND)


def test_one_whole_step_makes_a_linear_chain_right():
    """eps 0, g 1 and the true H: the next re-recording is the target."""
    target = noise()
    frequency = np.linspace(0, 500, 501)
    response = Response(frequency=frequency, value=0.7 / (1 + 1j * frequency / 150))
    lacking = target - chain(target)
    change = IterativeCorrection(regularisation=0.0).change(lacking, RATE, response, band=(5.0, 495.0), step=1.0)
    error = target - chain(target + change)
    middle = slice(200, -200)
    assert np.linalg.norm(error[middle]) < 0.01 * np.linalg.norm(lacking[middle])


@pytest.mark.long
@given(st.floats(0.1, 1.0), st.integers(0, 5))
def test_every_step_on_a_chain_that_only_pushes_brings_it_nearer(step, seed):
    """Projected on positive pressure, as in the half-wave mode: five steps, each with less error."""
    target = noise(seed, frames=600)
    asked = np.maximum(target, 0)
    correction, errors = IterativeCorrection(step=1.0), []
    for _ in range(6):
        heard = in_band(chain(asked))
        errors.append(np.linalg.norm(target - heard))
        response = measured_response(asked, heard, RATE, band=BAND)
        change = correction.change(target - heard, RATE, response, band=BAND, step=step)
        asked = np.maximum(asked + change, 0)
    assert (np.diff(errors) < 0).all()


def test_a_band_without_response_is_not_amplified_without_limit():
    frequency = np.linspace(0, 500, 51)
    response = Response(frequency=frequency, value=np.where(frequency < 200, 1.0, 1e-6).astype(complex))
    change = IterativeCorrection(regularisation=0.01).change(noise(), RATE, response, band=BAND, step=1.0)
    assert np.abs(change).max() < 2 * np.abs(noise()).max()


@pytest.mark.parametrize(
    "wrong",
    [{"step": 0.0}, {"step": 3.0}, {"shrink": 1.0}, {"smallest": 0.9}, {"least": -1.0}, {"regularisation": -1.0}],
)
def test_steps_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError, match="correction: expected"):
        IterativeCorrection(**wrong)
