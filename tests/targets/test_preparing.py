from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.model import ControlGrid, Medium, PressureFrames, SensorGrid
from midair.physics import sound_amplitude
from midair.streaming import LazyFrames
from midair.targets import MAPPINGS, Circle, interpolation_matrix, precompensate_sound, prepare

PITCH = 11e-3


def frames(pressure, sensor=None):
    return PressureFrames(pressure=np.asarray(pressure, float), rate=1000.0, sensor=sensor or SensorGrid())


def one_channel(channel, pascal):
    pressure = np.zeros((1, 16))
    pressure[0, channel] = pascal
    return frames(pressure.reshape(1, 4, 4))


def test_one_channel_is_the_tent_of_the_hand_in_amplitude_or_pressure_with_its_gain():
    """Cell 1 is half a pitch before the middle; point i is (i - 7.5) / 3 pitches behind it: point 6 is on cell 1."""
    amplitude = prepare(one_channel(5, 100.0)).amplitude.reshape(16, 16)
    tent = np.zeros(16)
    tent[4:9] = [1 / 3, 2 / 3, 1, 2 / 3, 1 / 3]
    # p_amp = 340 m/s * sqrt(2 * 1.25 kg/m3 * 100 Pa / 2) = 3801.3 Pa
    np.testing.assert_allclose(amplitude, 340 * np.sqrt(125) * np.outer(tent, tent), rtol=1e-12)
    by_pressure = prepare(one_channel(5, 100.0), interpolate="pressure").amplitude.reshape(16, 16)
    assert by_pressure[6, 5] == pytest.approx(sound_amplitude(np.array(200 / 3), Medium()), rel=1e-12)
    plain, louder = prepare(one_channel(9, 10.0)), prepare(one_channel(9, 10.0), gain=4.0)
    np.testing.assert_allclose(louder.amplitude, 2 * plain.amplitude, rtol=1e-12)


def test_half_wave_drops_suction_and_a_constant_offset_keeps_the_differences():
    for interpolate in ("amplitude", "pressure"):
        assert not prepare(one_channel(3, -50.0), interpolate=interpolate).amplitude.any(), interpolate
    pressure = np.random.default_rng(0).normal(size=(7, 4, 4))
    lifted = MAPPINGS["constant-offset"](pressure)
    assert lifted.min() >= 0
    np.testing.assert_allclose(np.diff(lifted, axis=0), np.diff(pressure, axis=0), atol=1e-12)


def test_the_border_of_the_grid_fades_to_the_ring_of_zeros_beyond_which_points_have_no_weight():
    """All channels equal: 1 on and between cells, 1/3 and 2/3 towards the ring; the ring itself is outside 16 x 16."""
    fine = (interpolation_matrix(SensorGrid(), ControlGrid()) @ np.ones(16)).reshape(16, 16)
    edge = np.array([0, 1 / 3, 2 / 3, *[1] * 10, 2 / 3, 1 / 3, 0])
    np.testing.assert_allclose(fine, np.outer(edge, edge), atol=1e-12)
    wide = ControlGrid(rows=3, columns=3, pitch=0.1)
    weights = interpolation_matrix(SensorGrid(), wide)
    assert weights[4].sum() == pytest.approx(1)
    assert not np.delete(weights, 4, axis=0).any()


@given(rows=st.integers(1, 5), columns=st.integers(1, 5), pitch=st.floats(1e-3, 5e-2))
def test_points_on_the_cells_read_the_cells(rows, columns, pitch):
    sensor = SensorGrid(rows=rows, columns=columns, pitch=pitch)
    grid = ControlGrid(rows=rows, columns=columns, pitch=pitch, centre=(0.03, -0.01))
    np.testing.assert_allclose(interpolation_matrix(sensor, grid), np.eye(rows * columns), atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), points=st.integers(1, 9))
def test_inside_the_cells_a_plane_stays_a_plane(seed, points):
    sensor = SensorGrid(rows=3, columns=4)
    slope = np.random.default_rng(seed).normal(size=2)
    grid = ControlGrid(rows=points, columns=points, pitch=2 * PITCH / 9)
    plane = (slope[0] * sensor.y[:, None] + slope[1] * sensor.x).ravel()
    expected = (slope[0] * grid.y[:, None] + slope[1] * grid.x).ravel()
    np.testing.assert_allclose(interpolation_matrix(sensor, grid) @ plane, expected, atol=1e-12)


def test_any_sensor_and_any_grid_and_the_step_is_written_down():
    sensor, grid = SensorGrid(rows=2, columns=5, pitch=4e-3), ControlGrid(rows=7, columns=3, pitch=2e-3, height=0.1)
    ready = prepare(frames(np.ones((4, 2, 5)), sensor), grid=grid)
    assert ready.amplitude.shape == (4, 21)
    assert ready.grid is grid
    source = frames(np.ones((1, 4, 4)))
    step = prepare(source, gain=1.5, interpolate="pressure").provenance.steps[-1]
    assert step.stage == "prepare"
    assert step.settings["gain"] == 1.5
    assert step.settings["interpolate"] == "pressure"


def test_a_streamed_target_is_the_same_as_one_in_memory(monkeypatch, subtests):
    """To rounding; pre-compensated to what its answer has left after two seconds, most of it at half the rate."""
    monkeypatch.setattr("midair.dsp.BYTES", 2**17)
    grid = ControlGrid(rows=4, columns=4, pitch=11e-3)
    pressure = frames(20 * np.random.default_rng(0).standard_normal((5000, 4, 4)))
    for circle, (act, rest) in product([None, Circle()], [(lambda made: made, 1e-9), (precompensate_sound, 1e-2)]):
        with subtests.test(circle=circle, rest=rest):
            whole, made = (act(prepare(pressure, circle=circle, grid=grid, streamed=each)) for each in (False, True))
            assert isinstance(made.amplitude, LazyFrames)
            assert made.provenance == whole.provenance
            difference = np.linalg.norm(np.asarray(made.amplitude) - whole.amplitude)
            assert difference < rest * np.linalg.norm(whole.amplitude)


FINE = ControlGrid(rows=61, columns=61, pitch=1e-3)


def steady(frames=400, rate=1000.0):
    pressure = np.zeros((frames, 4, 4))
    pressure[:, 1, 1] = 10.0
    return PressureFrames(pressure=pressure, rate=rate)


def centroid(amplitude):
    maps = amplitude.reshape(-1, 61, 61)
    total = maps.sum(axis=(1, 2))
    return np.stack([maps.sum(axis=1) @ FINE.x, maps.sum(axis=2) @ FINE.y], axis=1) / total[:, None]


def test_the_pattern_turns_once_in_a_fifth_of_a_second_which_the_text_describes():
    still = centroid(prepare(steady(), grid=FINE).amplitude)
    moved = centroid(prepare(steady(), grid=FINE, circle=Circle(radius=3e-3, frequency=5.0)).amplitude) - still
    np.testing.assert_allclose(np.hypot(*moved.T), 3e-3, atol=5e-5)
    np.testing.assert_allclose(moved[0], [3e-3, 0], atol=5e-5)
    np.testing.assert_allclose(moved[50], [0, 3e-3], atol=5e-5)
    np.testing.assert_allclose(moved[200:], moved[:200], atol=1e-9)
    step = prepare(steady(2), circle=Circle()).provenance.steps[-1]
    assert step.settings["motion"] == "circle of 3 mm at 5 Hz, not validated on people"
    assert (step.settings["circle_m"], step.settings["circle_hz"]) == (3e-3, 5.0)
    assert "motion" not in prepare(steady(2)).provenance.steps[-1].settings
