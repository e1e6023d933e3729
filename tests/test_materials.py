import numpy as np
import pytest
from benchmarks.materials import MaterialsPlan, left_out_names, material_of, materials_table, recorded

from midair.datasets import stroke
from midair.files import save
from midair.model import Calibration, ControlGrid, PressureFrames, Recording, SensorGrid
from midair.paper.modes_compared import strongest_part
from midair.settings import Settings

COARSE = Settings().but(grid=ControlGrid(rows=4, columns=4, pitch=11e-3), method="glide")


@pytest.mark.long
def test_a_classifier_separates_only_different_materials():
    rng = np.random.default_rng(0)
    truth = np.repeat([0, 1, 2], 30)
    apart = rng.standard_normal((90, 13)) + 4 * truth[:, None]
    assert np.mean(left_out_names(apart, apart, truth) == truth) > 0.95
    alike = rng.standard_normal((90, 13))
    assert np.mean(left_out_names(alike, alike, truth) == truth) < 0.55


@pytest.mark.long
def test_the_classified_stroke_is_not_in_the_training_set():
    # One stroke differs from all others and has a common label; only a classifier trained on it would know it.
    rng = np.random.default_rng(3)
    truth = np.repeat([0, 1], 10)
    shapes = rng.standard_normal((20, 5)) + 6 * truth[:, None]
    shapes[0] += 6
    assert left_out_names(shapes, shapes, truth)[0] == 1


def test_the_strongest_part_is_found():
    pressure = np.zeros((3000, 1, 1))
    pressure[1700:1900, 0, 0] = np.cos(2 * np.pi * 100 * np.arange(200) / 1000)
    frames = PressureFrames(pressure=pressure, rate=1000.0, sensor=SensorGrid(rows=1, columns=1))
    assert strongest_part(frames, 0.2).pressure == pytest.approx(pressure[1700:1900], abs=0.05)
    assert strongest_part(frames, 5.0) is frames


def write(path, seed):
    felt = stroke("towel", seed=seed)
    recording = Recording(samples=felt.pressure, rate=felt.rate, unit="Pa")
    path.parent.mkdir(exist_ok=True)
    save(recording, path, calibration=Calibration.flat(recording.sensor, sensitivity=1.0, unit="Pa"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("strokes")
    for number in range(3):
        write(where / f"denim_{number}.h5", number)
        write(where / "old wool" / f"take {number}.h5", number)
    return where


def test_materials_are_named_by_folder_or_file_name(folder):
    strokes = recorded(folder, 0.3)
    assert sorted({one.material for one in strokes}) == ["denim", "old wool"]
    assert strokes[0].original(COARSE, 0.3).frames == 300
    assert material_of(folder / "cork.h5", folder) == "cork"


def test_the_live_mode_inverts_the_sensor_causally(folder):
    stroke_ = recorded(folder, 0.3)[0]
    zero_phase, causal = (part(COARSE, 0.3).pressure for part in (stroke_.original, stroke_.live))
    assert causal.shape == zero_phase.shape
    # The delay is removed, so the correlation has its maximum at a lag of 0.
    alike = [np.sum(zero_phase[20:-20] * causal[20 + lag : len(causal) - 20 + lag]) for lag in range(-10, 11)]
    assert np.argmax(alike) == 10
    # The pressures differ, because the filter uses only 6 ms of future samples: errors of 7 to 39 % by band.
    off = np.linalg.norm(causal - zero_phase) / np.linalg.norm(zero_phase)
    assert 0.03 < off < 0.4


@pytest.mark.slow
def test_the_table_has_a_row_for_the_originals_and_each_mode():
    result = materials_table(MaterialsPlan(strokes=3, duration=0.1, mode="quick", paper=COARSE))
    assert [row["mode"] for row in result.rows] == ["original", "paper", "quick", "live"]
    assert set(result.pictures) == {"materials.png"}
    for row in result.rows:
        counted = [value for name, value in row.items() if "_as_" in name and not name.startswith("as_")]
        assert sum(counted) == row["strokes"] == 9
        assert 0 <= row["named_right_low"] <= row["named_right"] <= row["named_right_high"] <= 1
    assert result.rows[0]["shape_off_db"] == 0
    assert result.rows[2]["shape_off_db"] < result.rows[1]["shape_off_db"]
