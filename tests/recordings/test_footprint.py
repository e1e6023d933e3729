from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.model import Recording, SensorGrid
from midair.recordings.footprint import Footprint, covered, disc_in_rectangle, footprint_field

SENSOR = SensorGrid()
CELL = SENSOR.pitch**2

footprints = st.builds(
    Footprint,
    shape=st.sampled_from(["circle", "square", "line"]),
    size=st.floats(1e-3, 60e-3),
    speed=st.floats(-0.3, 0.3).filter(lambda v: abs(v) > 1e-3),
    path=st.sampled_from(["x", "y", "diagonal"]),
    turn=st.sampled_from(["stop", "back", "again"]),
)


def mono(samples, rate=1000.0):
    samples = np.reshape(samples, (-1, 1, 1))
    return Recording(samples=samples, rate=rate, sensor=SensorGrid(rows=1, columns=1), unit="Pa")


def still(**says):
    return covered(Footprint(speed=0.0, **says), SENSOR, np.zeros(1))[0]


def test_the_area_of_a_disc_in_a_rectangle_by_hand():
    one = np.ones(())
    assert disc_in_rectangle(-one, one, -one, one, 1.0) == pytest.approx(np.pi)
    assert disc_in_rectangle(0 * one, one, 0 * one, one, 1.0) == pytest.approx(np.pi / 4)
    assert disc_in_rectangle(0.5 * one, one, -one, one, 1.0) == pytest.approx(np.pi / 3 - np.sqrt(3) / 4)
    assert disc_in_rectangle(-0.5 * one, 0.5 * one, -0.5 * one, 0.5 * one, 1.0) == pytest.approx(1)
    assert disc_in_rectangle(2 * one, 3 * one, -one, one, 1.0) == pytest.approx(0, abs=1e-15)


@settings(max_examples=40)
@given(footprint=footprints, part=st.floats(0, 1))
def test_shares_agree_with_counting_points(footprint, part):
    fine = 60
    time = np.array([part * footprint.crossing(SENSOR)])
    share = covered(footprint, SENSOR, time)[0]
    place = (np.arange(4 * fine) + 0.5) * SENSOR.pitch / fine - 2 * SENSOR.pitch
    x0, y0 = footprint.centre(time, SENSOR)[0]
    x, y = np.meshgrid(place - x0, place - y0)
    half = footprint.size / 2
    along = {"x": x, "y": y, "diagonal": (x + y) / np.sqrt(2)}[footprint.path]
    inside = {
        "circle": x**2 + y**2 < half**2,
        "square": (np.abs(x) < half) & (np.abs(y) < half),
        "line": np.abs(along) < half,
    }[footprint.shape]
    counted = inside.reshape(4, fine, 4, fine).mean(axis=(1, 3))
    np.testing.assert_allclose(share, counted, atol=2.5 / fine)


@given(footprint=footprints)
def test_it_touches_during_its_crossing_and_not_after_and_mirrored_the_other_way(footprint):
    whole = footprint.crossing(SENSOR)
    touched = covered(replace(footprint, turn="stop"), SENSOR, np.array([0.0, 0.01, 0.5, 0.99, 1.0, 1.3]) * whole).sum(
        axis=(1, 2)
    )
    assert touched[0] == pytest.approx(0, abs=1e-9)
    assert (touched[1:4] > 0).all()
    np.testing.assert_allclose(touched[4:], 0, atol=1e-9)
    time = np.linspace(0, whole, 9)
    there, back = (covered(each, SENSOR, time) for each in (footprint, replace(footprint, speed=-footprint.speed)))
    np.testing.assert_allclose(back, there[:, ::-1, ::-1], atol=1e-9)


def test_a_circle_stays_on_the_sensor_and_runs_at_its_speed():
    """44 mm of cells: a circle of 11 mm, which takes 1.382 s at 50 mm/s; a negative speed runs it the other way."""
    lap = 2 * np.pi * 11e-3 / 50e-3
    forth, back = (Footprint(path="circle", speed=speed) for speed in (50e-3, -50e-3))
    np.testing.assert_allclose(forth.centre([lap / 4, lap], SENSOR), [(0, 11e-3), (11e-3, 0)], atol=1e-12)
    np.testing.assert_allclose(back.centre([lap / 4, 0], SENSOR), [(0, -11e-3), (11e-3, 0)], atol=1e-12)
    area = covered(forth, SENSOR, np.linspace(0, 2 * lap, 50)).sum(axis=(1, 2)) * SENSOR.pitch**2
    np.testing.assert_allclose(area, np.pi * 10e-3**2, rtol=1e-9)
    assert (forth.crossing(SENSOR), *Footprint(path="circle", speed=0).centre([1.0], SENSOR)[0]) == (np.inf, 0, 0)


def test_turning_back_and_starting_again():
    time = np.linspace(0, 1.28, 50)
    forth = covered(Footprint(), SENSOR, time)
    back = covered(Footprint(turn="back"), SENSOR, 2.56 - time)
    again = covered(Footprint(turn="again"), SENSOR, 1.28 + time[1:-1])
    np.testing.assert_allclose(back, forth, atol=1e-9)
    np.testing.assert_allclose(again, forth[1:-1], atol=1e-9)


def test_force_is_the_waveform_times_the_area_that_touches():
    rng = np.random.default_rng(0)
    wave = rng.normal(size=1280)
    field = footprint_field(mono(wave), Footprint())
    force = field.samples.sum(axis=(1, 2)) * CELL
    area = covered(Footprint(), SENSOR, field.time).sum(axis=(1, 2)) * CELL
    np.testing.assert_allclose(force, wave * area)
    inside = area > np.pi * 10e-3**2 * (1 - 1e-9)
    assert inside.sum() == pytest.approx(1000 * 24 / 50, abs=2)  # fully on the sensor for 24 of 64 mm
    np.testing.assert_allclose(force[inside], wave[inside] * np.pi * 10e-3**2)


def test_speed_moves_the_patch_and_leaves_the_waveform():
    wave = np.sin(np.arange(400) * 0.3)
    for speed in (0.05, 0.3):
        edge = Footprint(shape="line", size=1.0, speed=speed)
        field = footprint_field(mono(wave), edge)
        assert field.frames == 400
        whole = covered(edge, SENSOR, field.time) > 1 - 1e-9
        np.testing.assert_allclose(field.samples[whole], np.broadcast_to(wave[:, None, None], whole.shape)[whole])
        # So long until the edge has crossed the first column, of 11 mm.
        assert np.argmax(whole[:, 0, 0]) == np.ceil(11 / speed)


def test_the_field_is_marked_as_simulated():
    recording = mono(np.ones(10))
    square = Footprint(shape="square", size=5e-3, path="diagonal")
    field = footprint_field(recording, square, SensorGrid(rows=2, columns=3))
    assert field.sensor.shape == (2, 3)
    assert field.unit == "Pa"
    assert field.provenance.simulated
    step = field.provenance.steps[-1]
    assert step.stage == "footprint"
    assert step.settings["field"].startswith("synthetic")
    assert (step.settings["shape"], step.settings["size_m"], step.settings["path"]) == ("square", 5e-3, "diagonal")


def test_shares_of_shapes_by_hand():
    expected = np.zeros((4, 4))
    expected[1:3, 1:3] = 0.25
    np.testing.assert_allclose(still(shape="square", size=11e-3), expected, atol=1e-12)
    expected = np.zeros((4, 4))
    expected[:, 1:3] = 0.5
    np.testing.assert_allclose(still(shape="line", size=11e-3), expected, atol=1e-12)
    np.testing.assert_allclose(still(shape="line", size=11e-3, path="y"), expected.T, atol=1e-12)
    # A bar of sqrt(2) cells across (row, column) -> column + row: all of those on the other diagonal.
    share = still(shape="line", size=11e-3 * np.sqrt(2), path="diagonal")
    np.testing.assert_allclose(np.diag(share[::-1]), 1)
    np.testing.assert_allclose(np.diag(share[::-1], 1), 0.5)
    np.testing.assert_allclose(np.diag(share[::-1], 2), 0, atol=1e-12)
    share = still(shape="circle", size=20e-3)
    assert share.sum() * CELL == pytest.approx(np.pi * 10e-3**2, rel=1e-12)
    np.testing.assert_allclose(share, share.T, atol=1e-12)
    np.testing.assert_allclose(share, share[::-1, ::-1], atol=1e-12)
