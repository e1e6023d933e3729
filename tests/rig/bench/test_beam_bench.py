"""Beam calibration on a virtual rig whose strength and cell sizes differ from the assumed values."""

from dataclasses import replace

import numpy as np
import pytest

from midair.calibration.measure.beam import BeamPlan, BeamSetting
from midair.devices import VirtualArray, VirtualSensor, VirtualSkin
from midair.errors import ExposureError, MismatchError, RateError
from midair.model import SensorGrid, TransducerArray
from midair.physics import SensorModel, channel_response
from midair.rig.bench.array_bench import calibrate_by_beam

ARRAY = TransducerArray.autd3(columns=1, rows=1)
PLAN = BeamPlan(levels=5, spacing=20.0, settle=0.05, high=460.0, top=150.0)
GRID = SensorGrid(rows=2, columns=2, name="small")


def by_beam(model, *, seed=0, strength=1.0, setting=None, plan=PLAN):
    skin = VirtualSkin(model)
    array = VirtualArray(ARRAY, skin, strength=strength, seed=seed)
    with array, VirtualSensor(skin, seed=seed) as sensor:
        return calibrate_by_beam(array, sensor, plan, setting=setting)


def ratio(calibration, model):
    return calibration.response / channel_response(model, calibration.frequency)


@pytest.fixture(scope="module")
def found():
    model = SensorModel(grid=GRID).with_spread(seed=1, gain=0.2)
    return by_beam(model, seed=1), model


def test_the_response_is_recovered_within_what_is_stated(found):
    calibration, model = found
    apart = ratio(calibration, model)
    assert (np.abs(np.abs(apart) - 1) < 2 * calibration.measurement.magnitude_uncertainty).all()
    assert (np.abs(np.angle(apart)) < 2 * calibration.measurement.phase_uncertainty).all()
    assert calibration.frequency[[0, -1]].tolist() == [20, 460]
    assert calibration.provenance.simulated
    assert "focused beam" in calibration.measurement.method


def test_differences_between_channels_have_a_smaller_uncertainty(found):
    calibration, model = found
    level = np.abs(ratio(calibration, model))
    between = level / level.mean(axis=(1, 2), keepdims=True)
    own = np.sqrt(calibration.measurement.magnitude_uncertainty**2 - calibration.measurement.reference_uncertainty**2)
    assert np.abs(between - 1).max() < 0.02
    assert np.median(own) < 0.02
    assert (np.abs(between - 1) < 2 * own + 0.003).mean() > 0.95


def test_the_beam_is_no_crosstalk(found):
    calibration, _ = found
    away = ~np.eye(4, dtype=bool)
    # the focus itself reaches the neighbours, which is known and taken off; the gel of the model adds next to nothing
    assert np.abs(calibration.crosstalk.matrix[away]).max() < 0.03
    assert calibration.crosstalk.uncertainty[away].max() < 0.03


def test_crosstalk_is_found():
    mixed = np.eye(4) + 0.1 * (1 - np.eye(4))
    calibration = by_beam(SensorModel(grid=GRID, crosstalk=mixed))
    away = ~np.eye(4, dtype=bool)
    apart = np.abs(calibration.crosstalk.matrix - mixed)[away]
    assert (apart < 2 * calibration.crosstalk.uncertainty[away]).mean() > 0.8
    assert apart.max() < 0.02


def test_saturation_is_found():
    line = by_beam(SensorModel(grid=GRID, saturation=1.0)).linearity
    assert (line.curvature + 2 * line.curvature_uncertainty < 0).all()


def test_a_plan_of_another_rate_is_refused():
    with pytest.raises(RateError, match="an integer multiple of the beam's 800 Hz, got 1000 Hz"):
        by_beam(SensorModel(grid=GRID), plan=BeamPlan(rate=800.0, high=380.0))


def test_a_gated_array_keeps_the_profile_and_needs_a_real_sensor():
    skin = VirtualSkin(SensorModel(grid=GRID))
    array, sensor = VirtualArray(ARRAY, skin), VirtualSensor(skin)
    array.gated = True
    with array, sensor, pytest.raises(ExposureError, match="--override-exposure"):
        calibrate_by_beam(array, sensor, PLAN)
    assert not array.emitting
    array.gated = array.simulated = False
    with array, sensor, pytest.raises(MismatchError, match="both real or both virtual"):
        calibrate_by_beam(array, sensor, PLAN)


@pytest.mark.slow
def test_uncertainty_covers_unknown_parameters():
    """Strength, aperture and spread are drawn with the stated uncertainties: inside k = 2 for about 95 % of rigs."""
    setting = BeamSetting(pressure_uncertainty=0.11)
    inside = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        model = replace(
            SensorModel(grid=GRID).with_spread(seed=seed),
            aperture=8e-3 + 0.25e-3 * rng.standard_normal(),
            spread=1e-3 + 0.25e-3 * np.clip(rng.standard_normal(), -2, 2),
        )
        calibration = by_beam(model, seed=seed, strength=1 + 0.05 * rng.standard_normal(), setting=setting)
        inside.append(
            (np.abs(np.abs(ratio(calibration, model)) - 1) < 2 * calibration.measurement.magnitude_uncertainty).mean()
        )
    assert np.mean(inside) > 0.85
