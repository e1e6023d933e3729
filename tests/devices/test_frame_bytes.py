import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from midair.devices.frame_bytes import amplitude_of, divider, intensity_bytes, phase_bytes
from midair.model import Drive, TransducerArray
from midair.physics import quantise_phase

ARRAY = TransducerArray.autd3(columns=2, rows=1)


def drive(phase, level=1.0):
    phase = np.broadcast_to(np.asarray(phase, float)[:, None], (len(phase), ARRAY.count))
    return Drive(phase=phase, level=np.full(len(phase), level), rate=1000.0, array=ARRAY)


def test_phases_by_hand():
    step = 2 * np.pi / 256
    phases = [0, step, np.pi, -step, 255.4 * step, 255.6 * step, 2 * np.pi, 100 * np.pi + step]
    assert phase_bytes(drive(phases), 2)[:, 1, 7].tolist() == [0, 1, 128, 255, 255, 0, 0, 1]


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20))
def test_bytes_are_what_physics_calls_quantised(phases):
    found = phase_bytes(drive(phases), 2)[:, 0, 0] * (2 * np.pi / 256)
    np.testing.assert_allclose(found, quantise_phase(np.array(phases)), atol=1e-12)


def test_units_come_one_after_the_other():
    phase = np.arange(ARRAY.count) * (2 * np.pi / 256)
    one = Drive(phase=phase[None], level=np.ones(1), rate=1000.0, array=ARRAY)
    assert phase_bytes(one, 2).shape == (1, 2, 249)
    assert phase_bytes(one, 2)[0, 1, 0] == 249
    assert phase_bytes(one, 2)[0, 1, 10] == (249 + 10) % 256


def test_intensity_and_its_amplitude():
    assert intensity_bytes(drive([0, 0], 0.5), 2).tolist() == [128, 128]
    every = np.arange(256, dtype=np.uint8)
    amplitude = amplitude_of(every)
    assert (amplitude[0], amplitude[255]) == (0, 1)
    assert (np.diff(amplitude) >= 0).all()
    assert np.abs(amplitude - every / 255).max() < 0.005


def test_rates_that_divide_40_khz():
    assert [divider(rate) for rate in (1000.0, 4000.0, 40e3, 40e3 / 7, 40e3 / 65535)] == [40, 10, 1, 7, 65535]
