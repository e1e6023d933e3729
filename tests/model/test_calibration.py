import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.model import ArrayCalibration, Calibration, ControlGrid, Crosstalk, Measurement, SensorGrid, TransducerArray
from midair.physics import focus_phase, transfer_matrix

SENSOR = SensorGrid(rows=2, columns=3)


def made(**changes):
    rng = np.random.default_rng(0)
    parts = {
        "sensor": SENSOR,
        "frequency": np.array([0.0, 10.0, 30.0]),
        "response": rng.standard_normal((3, 2, 3, 2)) @ np.array([1, 1j]),
        "noise": np.zeros((2, 3)),
    }
    return Calibration(**(parts | changes))


@given(st.floats(0, 1e5), st.floats(1e-6, 1e6))
def test_a_flat_one_is_the_same_everywhere(frequency, sensitivity):
    flat = Calibration.flat(SENSOR, sensitivity=sensitivity, unit="count")
    assert flat.response_at(np.array([frequency]))[0] == pytest.approx(np.full((2, 3), sensitivity))
    assert flat.unit == "count"
    assert "nominal" in flat.provenance.source


def test_bins_come_back_the_middle_is_the_mean_also_of_uncertainties_and_the_ends_are_held():
    calibration = made()
    assert calibration.response_at(calibration.frequency) == pytest.approx(calibration.response)
    between = calibration.response_at(np.array([5.0, 15.0]))
    assert between[0] == pytest.approx((calibration.response[0] + calibration.response[1]) / 2)
    assert between[1] == pytest.approx(0.75 * calibration.response[1] + 0.25 * calibration.response[2])
    calibration = made(frequency=np.array([5.0, 10.0, 30.0]))
    ends = calibration.response_at(np.array([0.0, 1e4]))
    assert ends == pytest.approx(calibration.response[[0, -1]])
    bins, cells = np.ones((3, 2, 3)), np.ones((2, 3))
    known = Measurement(
        magnitude_uncertainty=np.array([0.01, 0.02, 0.04])[:, None, None] * bins,
        **dict.fromkeys(("coherence", "phase_uncertainty", "noise_density"), bins),
        **dict.fromkeys(("noise_uncertainty", "delay", "delay_uncertainty"), cells),
    )
    calibration = made(measurement=known, frequency=np.array([10.0, 20.0, 30.0]))
    assert calibration.uncertainty_at(np.array([5.0, 15.0, 30.0]))[:, 0, 1] == pytest.approx([0.01, 0.015, 0.04])
    assert made().uncertainty_at(np.array([15.0])) is None


def test_the_identifier_tells_two_calibrations_apart_and_never_changes():
    changes = {
        "date": "2026-01-31",
        "version": 2,
        "unit": "count",
        "response": np.ones((3, 2, 3), complex),
        "noise": np.ones((2, 3)),
        "sensor": SensorGrid(rows=2, columns=3, name="another"),
        "crosstalk": Crosstalk(matrix=np.eye(6), uncertainty=np.zeros((6, 6))),
    }
    for name, value in changes.items():
        assert made().identifier == made().identifier != made(**{name: value}).identifier, name
    assert Calibration.flat(SensorGrid(name="skin"), sensitivity=0.02).identifier == "fdff85f2"


ARRAY = TransducerArray.autd3(columns=1, rows=1)
RNG = np.random.default_rng(0)


def calibration(array=ARRAY, **changes):
    count = array.count
    values = {
        "array": array,
        "response": (1 + 0.1 * RNG.standard_normal(count)) * np.exp(0.1j * RNG.standard_normal(count)),
        "pole": np.full(count, -5000 + 1300j),
        "dead": np.arange(count) == 7,
        **{f"{name}_uncertainty": np.full(count, 0.01) for name in ("strength", "phase", "resonance", "quality")},
    }
    return ArrayCalibration(**values | changes)


def test_an_array_that_was_measured_is_solved_for_as_it_is():
    known = calibration()
    array = known.applied(ARRAY)
    grid = ControlGrid(rows=3, columns=3)
    np.testing.assert_array_equal(transfer_matrix(grid, array), transfer_matrix(grid, ARRAY) * known.response)
    np.testing.assert_array_equal(array.nominal.response, np.ones(ARRAY.count))
    assert array.same_as(ARRAY)
    assert (ARRAY.alike, array.alike, array.nominal.alike) == (True, False, True)
    np.testing.assert_array_equal(array.pole, known.pole)
    assert len(array.nominal.pole) == 0
    place = np.array([0, 0, 0.2])
    G = transfer_matrix(place[None], array)
    assert np.abs(G @ np.exp(1j * focus_phase(array, place)))[0] == pytest.approx(np.abs(G).sum())


def test_resonance_and_quality_are_those_of_the_pole_and_tell_files_apart():
    known = calibration(pole=np.full(ARRAY.count, -1 / 188e-6 - 2j * np.pi * 200))
    np.testing.assert_allclose(known.resonance, 39800)
    # omega tau / 2, as in `midair.physics.playback`.
    np.testing.assert_allclose(known.quality, 2 * np.pi * 39800 * 188e-6 / 2)
    one, other = calibration(), calibration()
    assert one.identifier == calibration(response=one.response, pole=one.pole).identifier
    assert one.identifier != other.identifier
    assert "1 dead" in repr(one)
