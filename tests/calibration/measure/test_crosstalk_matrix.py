import numpy as np
import pytest

from midair.calibration.measure.frequency_response import FrequencyResponse
from midair.calibration.measure.take_sums import crosstalk_of

BANDS = 4
ALL = np.ones(BANDS, bool)


def fit(response, relative):
    """Response of two channels to a press on one cell, with the same relative uncertainty everywhere."""
    whole = np.broadcast_to(np.asarray(response, complex), (BANDS, 2))
    each = np.ones((BANDS, 2))
    return FrequencyResponse(
        frequency=np.arange(BANDS, dtype=float),
        terms=whole[..., None],
        uncertainty=np.where(np.abs(whole) > 0, relative, np.inf),
        coherence=each,
        noise=each,
        averages=each[0],
        excited=each,
    )


def test_each_channel_is_compared_with_its_own_cell():
    # H_ik: channel i, cell k. H_00 = 2, H_10 = .2; H_01 = .5, H_11 = 4j: C_01 = .5 / 2, C_10 = Re(.2 / 4j) = 0
    found = crosstalk_of([fit([2, 0.2], 0.01), fit([0.5, 4j], 0.01)], ALL)
    assert found.matrix == pytest.approx(np.array([[1, 0.25], [0, 1]]))
    # 1 % in H_01 and 1 % in H_00, four bins: .25 * .01 * sqrt(2) / sqrt(4)
    assert found.uncertainty[0, 1] == pytest.approx(0.25 * 0.01 * np.sqrt(2) / 2)
    assert found.uncertainty.diagonal() == pytest.approx([0, 0])


def test_variation_over_the_band_increases_the_uncertainty():
    changing = np.array([[1, 0.1], [1, 0.3], [1, 0.1], [1, 0.3]])
    found = crosstalk_of([fit(changing, 1e-6), fit([0, 1], 1e-6)], ALL)
    # weights go by 1 / (1 + ratio^2) of own and other; nearly even, so mean .2, standard error .1155 / sqrt(4)
    weight = 1 / (np.array([0.1, 0.3, 0.1, 0.3]) ** 2 * 2)
    mean = np.average([0.1, 0.3, 0.1, 0.3], weights=weight)
    scatter = np.average((np.array([0.1, 0.3, 0.1, 0.3]) - mean) ** 2, weights=weight)
    assert found.matrix[1, 0] == pytest.approx(mean)
    assert found.uncertainty[1, 0] == pytest.approx(np.sqrt(scatter / 3), rel=1e-3)


def test_only_the_bins_that_count():
    changing = np.array([[1, 0.1], [1, 9], [1, 0.1], [1, 9]])
    found = crosstalk_of([fit(changing, 0.01), fit([0, 1], 0.01)], np.array([True, False, True, False]))
    assert found.matrix[1, 0] == pytest.approx(0.1)


def test_variation_between_takes_adds_to_both():
    fits = [fit([2, 0.2], 1e-9), fit([0.5, 4], 1e-9)]
    found = crosstalk_of(fits, ALL, repeat=np.array([0.03, 0.04]))
    assert found.uncertainty[0, 1] == pytest.approx(0.25 * 0.05)
    assert found.uncertainty[1, 0] == pytest.approx(0.05 * 0.05)


def test_a_dead_channel_has_no_crosstalk():
    found = crosstalk_of([fit([0, 0.2], 0.01), fit([0, 4], 0.01)], ALL)
    assert found.matrix == pytest.approx(np.eye(2))
    assert not found.uncertainty.any()
