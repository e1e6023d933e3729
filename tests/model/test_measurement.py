from dataclasses import replace

import numpy as np
import pytest

from midair.model import Calibration, Crosstalk, Measurement, SensorGrid

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
