from dataclasses import replace

import numpy as np
import pytest

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.model import Calibration, Crosstalk, Linearity, Measurement, SensorGrid

SENSOR = SensorGrid(rows=1, columns=2)
BINS, CELLS = (3, 1, 2), (1, 2)


def measurement(**changes):
    parts = {
        "coherence": np.full(BINS, 0.99),
        "magnitude_uncertainty": np.array([0.01, 0.02, 0.04])[:, None, None] * np.ones(BINS),
        "phase_uncertainty": np.full(BINS, 0.01),
        "noise_density": np.full(BINS, 1e-6),
        "noise_uncertainty": np.full(CELLS, 0.01),
        "delay": np.array([[1e-4, -1e-4]]),
        "delay_uncertainty": np.full(CELLS, 1e-6),
    }
    return Measurement(**(parts | changes))


def linearity(**changes):
    one = {name: np.ones(CELLS) for name in ("gain", "intercept", "curvature")}
    unsure = {f"{name}_uncertainty": np.ones(CELLS) for name in one}
    levels = {"pressure": np.ones((5, *CELLS)), "output": np.ones((5, *CELLS))}
    return Linearity(**(one | unsure | levels | changes))


THREE = {name: np.ones((1, 3)) for name in ("gain", "intercept", "curvature")}
THREE |= {f"{name}_uncertainty": np.ones((1, 3)) for name in tuple(THREE)}
THREE |= {name: np.ones((5, 1, 3)) for name in ("pressure", "output")}


def calibration(**changes):
    parts = {
        "sensor": SENSOR,
        "frequency": np.array([10.0, 20.0, 30.0]),
        "response": np.ones(BINS, complex),
        "noise": np.zeros(CELLS),
    }
    return Calibration(**(parts | changes))


def crosstalk(size):
    return Crosstalk(matrix=np.eye(size), uncertainty=np.zeros((size, size)))


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: measurement(coherence=np.full(BINS, 1.1)), InputError, "0 to 1, got 1.1"),
        (lambda: measurement(phase_uncertainty=np.full(BINS, -1.0)), InputError, "phase uncertainty: .*-1"),
        (lambda: measurement(phase_uncertainty=np.ones((2, 1, 2))), ShapeError, "phase uncertainty"),
        (lambda: measurement(delay=np.full(CELLS, np.nan)), NonFiniteError, "delay"),
        (lambda: measurement(reference_uncertainty=-0.1), InputError, "reference uncertainty"),
        (lambda: Crosstalk(matrix=2 * np.eye(2), uncertainty=np.zeros((2, 2))), ShapeError, "1 on its diagonal"),
        (lambda: Crosstalk(matrix=np.ones((2, 3)), uncertainty=np.zeros((2, 3))), ShapeError, "square"),
        (lambda: linearity(gain=np.ones((2, 2))), ShapeError, "gain"),
        (lambda: linearity(curvature_uncertainty=-np.ones(CELLS)), InputError, "curvature uncertainty"),
        (lambda: calibration(version=0), InputError, "version"),
        (lambda: calibration(measurement=measurement(), frequency=np.array([1.0, 2, 3, 4])), ShapeError, "response"),
        (lambda: calibration(crosstalk=crosstalk(3)), ShapeError, "expected 2 x 2"),
        (lambda: calibration(linearity=linearity(**THREE)), ShapeError, "linearity: expected"),
    ],
)
def test_what_does_not_fit_is_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()


def test_uncertainty_between_the_bins():
    known = calibration(measurement=measurement())
    assert known.uncertainty_at(np.array([5.0, 15.0, 30.0]))[:, 0, 1] == pytest.approx([0.01, 0.015, 0.04])
    assert calibration().uncertainty_at(np.array([15.0])) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"date": "2026-01-31"},
        {"version": 2},
        {"unit": "count"},
        {"response": 2 * np.ones(BINS, complex)},
        {"noise": np.ones(CELLS)},
        {"sensor": SensorGrid(rows=1, columns=2, name="another")},
        {"crosstalk": crosstalk(2)},
    ],
)
def test_the_identifier_tells_two_calibrations_apart(changes):
    one = calibration()
    assert one.identifier == calibration().identifier
    assert replace(one, **changes).identifier != one.identifier
    assert len(one.identifier) == 8
