"""What the uncertainties of a laboratory leave of a drive."""

import json

import numpy as np
import pytest

from midair.cli.app import run
from midair.errors import BrokenFileError
from midair.evaluate import ALL, ALL_FOLLOWED, ALL_MEASURED, LaboratoryLoss
from midair.files import Laboratory, load_laboratory, save_laboratory
from midair.model import Acoustics, ArrayCalibration, ControlGrid, Drive, PressureFrames, SensorGrid, TransducerArray
from midair.physics import SensorModel, cell_weights, focus_phase, radiation_pressure, transfer_matrix
from midair.rig.correction.laboratory import PARTS, laboratory_loss

SENSOR = SensorModel.usual(SensorGrid(rows=2, columns=2))
GRID = ControlGrid(rows=6, columns=6, pitch=11e-3 / 3)
ARRAY = TransducerArray.autd3(columns=1, rows=1)
NOTHING = Laboratory(**dict.fromkeys((name for names in PARTS.values() for name in names), 0.0))


@pytest.fixture(scope="module")
def focus() -> tuple[Drive, PressureFrames]:
    """A blurred focus that moves at 100 Hz, and the pressure on the cells by an own computation."""
    swing = np.sin(2 * np.pi * 100 * np.arange(120) / 1000)
    blur = np.random.default_rng(0).standard_normal(ARRAY.count)
    phase = np.stack([focus_phase(ARRAY, np.array([8e-3 * each, 2e-3, 0.2])) + blur for each in swing])
    drive = Drive(phase=phase, level=np.full(120, 0.5), rate=1000.0, array=ARRAY)
    points = ControlGrid(rows=16, columns=16, pitch=11e-3 / 4)
    field = drive.q @ transfer_matrix(points, ARRAY).T
    cells = radiation_pressure(np.abs(field), Acoustics().medium) @ cell_weights(SENSOR, points, between="waves").T
    return drive, PressureFrames(pressure=cells.reshape(-1, 2, 2), rate=1000.0, sensor=SENSOR.grid, band=(20.0, 400.0))


def loss(focus, laboratory, **options) -> LaboratoryLoss:
    drive, asked = focus
    known = {"judged": (0.02, 0.08), "band": (20.0, 400.0), "draws": (3, 3)} | options
    return laboratory_loss(asked, drive, laboratory, sensor=SENSOR, grid=GRID, **known)


def test_without_uncertainty_nothing_is_lost(focus) -> None:
    found = loss(focus, NOTHING)
    assert found.nominal > 40
    assert list(found.ratios) == [ALL, ALL_MEASURED]
    np.testing.assert_allclose(found.ratios[ALL], found.nominal, atol=1e-6)


def test_a_palm_that_lies_aside_and_turned_is_told_and_no_distortion(focus) -> None:
    lab = NOTHING.but(palm_aside_mm=3.0, palm_turn_deg=5.0)
    free, fixed = loss(focus, lab), loss(focus, lab, fixed_place=True)
    np.testing.assert_allclose(free.ratios[ALL], free.nominal, atol=1e-6)
    assert np.median(fixed.ratios[ALL]) < fixed.nominal - 10
    assert free.place.startswith("4.2 mm, 5° off; people feel points")
    assert (fixed.place, set(fixed.ratios) - set(free.ratios)) == (
        "",
        {"palm sideways", "palm rotation", ALL_FOLLOWED},
    )


@pytest.mark.long
def test_each_uncertainty_costs_more_when_it_is_larger(focus) -> None:
    small = Laboratory(frequency=2e-3)
    doubled = {name: 2 * getattr(small, name) for names in PARTS.values() for name in names}
    one, other = (loss(focus, lab, fixed_place=True) for lab in (small, small.but(**doubled)))
    for name in PARTS:
        assert np.median(other.ratios[name]) < np.median(one.ratios[name]) < one.nominal + 0.1, name
    assert np.median(other.ratios[ALL]) < np.median([np.median(other.ratios[name]) for name in PARTS])
    assert other.rows()[0][0] == other.largest
    assert other.advice.startswith(f"the biggest risk, {other.largest} (")


def test_following_is_advised_only_where_it_gains() -> None:
    ratios = {"palm height": np.full(3, 20.0), ALL: np.full(3, 10.0), ALL_MEASURED: np.full(3, 18.0)}
    for gained, advised in ((0.4, False), (6.0, True)):
        found = ratios | {ALL_FOLLOWED: np.full(3, 18.0 + gained)}
        loss = LaboratoryLoss(nominal=30, ratios=found, stated={"palm height": "3 mm"}, seed=0)
        assert ("--follow, which gains 6 dB" in loss.advice) == advised


@pytest.mark.long
def test_the_seed_gives_the_same_laboratories(focus) -> None:
    lab = NOTHING.but(palm_aside_mm=2.0)
    first, again, other = (loss(focus, lab, seed=seed, fixed_place=True) for seed in (1, 1, 2))
    assert json.dumps(first.plain()) == json.dumps(again.plain())
    assert not np.array_equal(first.ratios[ALL], other.ratios[ALL])


@pytest.mark.long
def test_a_measured_array_leaves_the_uncertainty_of_its_measurement(focus) -> None:
    count = ARRAY.count
    known = ArrayCalibration(
        array=ARRAY,
        response=np.ones(count, complex),
        pole=np.full(count, -5000.0 + 0j),
        strength_uncertainty=np.full(count, 0.01),
        phase_uncertainty=np.full(count, 0.01),
        resonance_uncertainty=np.full(count, 1.0),
        quality_uncertainty=np.full(count, 0.01),
        dead=np.zeros(count, bool),
    )
    lab = NOTHING.but(strength=0.2, resonance_hz=500.0, unit_position_mm=0.5, dead=0.05)
    before, after = loss(focus, lab), loss(focus, lab, measured=known)
    assert np.median(before.ratios[ALL_MEASURED]) > np.median(before.ratios[ALL]) + 3
    assert ALL_MEASURED not in after.ratios
    assert after.measured
    assert after.stated["transducers"] == "as measured"
    for name in ("transducers", "units", "dead transducers"):
        assert np.median(after.ratios[name]) > np.median(before.ratios[name]) + 3, name


def test_the_file_keeps_every_value_and_names_what_is_wrong(tmp_path) -> None:
    path = tmp_path / "lab.toml"
    save_laboratory(Laboratory(palm_aside_mm=7.5), path)
    assert load_laboratory(path) == Laboratory(palm_aside_mm=7.5)
    for text, message in (
        ("palm_side_mm = 3", "palm_side_mm"),
        ("dead = 2.0", "dead: expected"),
        ("reflection = 'a'", "reflection"),
    ):
        path.write_text(text)
        with pytest.raises(BrokenFileError, match=message):
            load_laboratory(path)


@pytest.mark.long
def test_the_budget_has_the_part_of_the_laboratory(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.6s"]) == 0
    assert run(["doctor", "--lab", "lab.toml"]) == 0
    assert run(["doctor", "--lab", "lab.toml"]) == 1
    capsys.readouterr()
    quick = ["--method", "fast", "--start-at", "0.4s", "--duration", "0.03s", "--lead", "0s"]
    assert run(["budget", "take.h5", "--lab", "lab.toml", *quick, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["laboratory"]
    assert set(found["uncertainties"]) == {*PARTS, ALL, ALL_MEASURED, ALL_FOLLOWED} - {"palm sideways", "palm rotation"}
    assert found["uncertainties"][ALL]["median_db"] < found["nominal_db"]
