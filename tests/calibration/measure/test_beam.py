"""Plan and analysis of the beam calibration on hand-made numbers; tests/rig/test_calibration_beam.py plays it."""

import numpy as np
import pytest

from midair.calibration.measure.beam import (
    BeamPlan,
    BeamReading,
    BeamSetting,
    beam_field,
    find_lag,
    focus_position,
    measure_beam,
    tone_amplitudes,
)
from midair.errors import InputError
from midair.model import Recording, SensorGrid, TransducerArray

PLAN = BeamPlan(levels=5, spacing=20.0, settle=0.05, high=460.0)
SENSOR = SensorGrid(rows=1, columns=2)


def test_the_plan_at_hand_computed_numbers():
    assert PLAN.tones.tolist() == [20, 40, 60, 100, 140, 180, 220, 260, 300, 340, 380, 420, 460]
    assert (PLAN.window, PLAN.stretch) == (50, 120)
    wave = PLAN.waveform.reshape(5, 120)
    assert wave[:, :50].max(axis=1) == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert wave.min() >= 0
    # settling time and window are whole periods of 50 ms, so the signal is periodic over both
    assert wave[:, 50:100] == pytest.approx(wave[:, :50], abs=1e-12)
    assert BeamPlan().tones[[0, 1, 8, 9, -1]].tolist() == [20, 25, 60, 70, 470]


def test_tones_are_found_at_their_level_phase_and_lag():
    amplitude = np.arange(1, 14)[:, None] * np.exp(1j * np.arange(13))[:, None]
    time = (np.arange(PLAN.stretch) - 50) / PLAN.rate
    one = (amplitude * np.exp(2j * np.pi * PLAN.tones[:, None] * time)).real.sum(axis=0)
    signal = 7 + np.concatenate([np.zeros(3), *(level * one for level in range(1, 6))])
    found = tone_amplitudes(signal[:, None], PLAN.rate, PLAN, lag=3)
    assert found.shape == (5, 13, 1)
    assert found[..., 0] == pytest.approx(np.arange(1, 6)[:, None] * amplitude.T, abs=1e-9)
    rng = np.random.default_rng(0)
    signal = np.concatenate([np.zeros(17), PLAN.waveform, np.zeros(30)]) + 0.05 * rng.standard_normal(647)
    assert find_lag(signal, PLAN.waveform) == 17


def reading(*, response, crosstalk, shares, changed=None, bend=0.0, noise=0.0, offset=0.0):
    """Outputs of two channels with a known response to a beam on each of two cells."""
    rng = np.random.default_rng(0)
    commanded = np.arange(1, 6)[:, None] * np.exp(1j * np.linspace(0, 3, 13))
    mixed = np.diag(response) @ crosstalk @ shares
    size = np.abs(commanded)
    output = np.einsum("ck,lt->kltc", mixed, commanded * (1 + bend * size)) + offset
    output = output + noise * (rng.standard_normal(output.shape) + 1j * rng.standard_normal(output.shape))
    known = {"plan": PLAN, "commanded": commanded, "slow": np.zeros(13), "level": 0.1, "timing": 1e-4}
    changed = np.array([shares] if changed is None else changed)
    return BeamReading(output=output, shares=np.array(shares), changed_shares=changed, **known)


def quiet(noise=1e-6):
    samples = noise * np.random.default_rng(1).standard_normal((4000, 1, 2))
    return Recording(samples=samples, rate=1000.0, sensor=SENSOR)


def measured(**changes):
    parts = {"response": [0.02, 0.03], "crosstalk": np.eye(2), "shares": [[0.5, 0.02], [0.03, 0.4]]}
    return measure_beam(reading(**(parts | changes)), sensor=quiet(), quiet=quiet())


def test_response_and_crosstalk_are_measured():
    crosstalk = np.array([[1, 0.06], [0.04, 1]])
    found = measured(crosstalk=crosstalk, offset=1e-3 + 2e-3j)
    assert found.response == pytest.approx(np.broadcast_to([[0.02, 0.03]], (13, 1, 2)), rel=1e-9)
    assert found.crosstalk.matrix == pytest.approx(crosstalk, abs=1e-9)
    assert (found.frequency == PLAN.tones).all()
    assert found.measurement.magnitude_uncertainty == pytest.approx(np.full((13, 1, 2), 0.1), rel=1e-3)
    assert found.measurement.phase_uncertainty[:, 0, 0] == pytest.approx(2 * np.pi * PLAN.tones * 1e-4, rel=1e-2)


def test_an_uncertain_length_makes_the_level_uncertain():
    # all cells get a fifth more: H would be a sixth smaller, fully shared
    found = measured(changed=[[[0.6, 0.024], [0.036, 0.48]]])
    assert found.measurement.reference_uncertainty == pytest.approx(np.hypot(0.1, 1 / 6), rel=1e-6)
    # one cell only: the other channel is more certain, which limits the shared part
    found = measured(shares=[[0.5, 0], [0, 0.4]], changed=[[[0.6, 0], [0, 0.4]]])
    assert found.measurement.magnitude_uncertainty[0, 0] == pytest.approx([np.hypot(0.1, 1 / 6), 0.1], rel=1e-3)
    assert found.measurement.reference_uncertainty == pytest.approx(0.1, rel=1e-3)


def test_a_bend_shows():
    line = measured(bend=-0.01).linearity
    assert line.levels == 5
    # output a x (1 - .01 x) from 1 to 5: the slope falls by .08 of about .94
    assert line.curvature == pytest.approx(np.full((1, 2), -0.085), abs=0.003)
    assert measured().linearity.curvature == pytest.approx(np.zeros((1, 2)), abs=1e-6)


def test_noise_is_covered_and_a_channel_without_signal_is_named():
    inside = []
    found = measured(noise=2e-4)
    random = np.sqrt(found.measurement.magnitude_uncertainty**2 - 0.1**2)
    inside = np.abs(np.abs(found.response) / [[[0.02, 0.03]]] - 1) < 2 * random
    assert inside.mean() > 0.85
    assert np.median(random) < 0.02
    with pytest.raises(InputError, match="got none on channels 1"):
        measured(response=[0.02, 0.0], noise=1e-4)


def test_the_field_on_the_cells():
    array, sensor = TransducerArray.autd3(columns=1, rows=1), SensorGrid(rows=1, columns=2)
    setting = BeamSetting()
    field = beam_field(array, sensor, setting)
    on = field.on_cells(setting)
    assert focus_position(sensor, 1, setting) == pytest.approx([5.5e-3, 0, 0.2])
    # a symmetric array over the centre: both cells are equal, with most pressure on the focused cell
    assert on[0, 0] == pytest.approx(on[1, 1], rel=0.05)
    assert on[0, 1] < 0.5 * on[1, 1]
    # cells average over an aperture wider than the focus: less than its peak
    assert (np.diag(on) < field.middle).all()
    changed = field.changed(setting)
    assert changed.shape == (4, 2, 2)
    # a wider or softer cell averages to a lower pressure
    assert (np.diagonal(changed[:2], axis1=1, axis2=2) < np.diag(on)).all()
