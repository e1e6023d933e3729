"""What the uncertainties of a laboratory leave of a drive."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy
from tests.model.test_calibration import calibration

from midair.cli.app import run
from midair.errors import BrokenFileError
from midair.evaluate import ALL, ALL_FOLLOWED, ALL_MEASURED, LaboratoryLoss, fidelity
from midair.files import Laboratory, load_laboratory, save_laboratory
from midair.model import Acoustics, ControlGrid, Drive, PressureFrames, SensorGrid, TransducerArray
from midair.physics import (
    SensorModel,
    TransducerDynamics,
    cell_weights,
    envelope,
    focus_amplitude,
    focus_phase,
    off_axis,
    radiation_pressure,
    transfer_matrix,
)
from midair.rig.correction.laboratory import PARTS, _pose, _Stage, laboratory_loss

SENSOR = SensorModel.usual(SensorGrid(rows=2, columns=2))
GRID = ControlGrid(rows=6, columns=6, pitch=11e-3 / 3)
ARRAY = TransducerArray.autd3(columns=1, rows=1)
NOTHING = Laboratory(**dict.fromkeys((name for names in PARTS.values() for name in names), 0.0))


@pytest.fixture(scope="module")
def focus() -> tuple[Drive, PressureFrames]:
    """A blurred focus that moves at 100 Hz, and the pressure on the cells by an own computation."""
    swing = np.sin(2 * np.pi * 100 * np.arange(480) / 4000)
    blur = np.random.default_rng(0).standard_normal(ARRAY.count)
    phase = np.stack([focus_phase(ARRAY, np.array([8e-3 * each, 2e-3, 0.2])) + blur for each in swing])
    drive = Drive(phase=phase, level=np.full(480, 0.5), rate=4000.0, array=ARRAY)
    points = ControlGrid(rows=16, columns=16, pitch=11e-3 / 4)
    held = envelope(drive.q, 4000.0, 4, TransducerDynamics(), start=drive.q[0])
    field = held @ transfer_matrix(points, ARRAY).T
    cells = radiation_pressure(np.abs(field), Acoustics().medium) @ cell_weights(SENSOR, points, between="waves").T
    return drive, PressureFrames(pressure=cells.reshape(-1, 2, 2), rate=16e3, sensor=SENSOR.grid, band=(20.0, 400.0))


def loss(focus, laboratory, **options) -> LaboratoryLoss:
    drive, asked = focus
    known = {"judged": (0.02, 0.08), "band": (20.0, 400.0), "draws": (3, 3)} | options
    return laboratory_loss(asked, drive, laboratory, sensor=SENSOR, grid=GRID, **known)


def test_without_uncertainty_nothing_is_lost(focus) -> None:
    found = loss(focus, NOTHING)
    assert list(found.ratios) == [ALL, ALL_MEASURED]
    np.testing.assert_allclose(found.ratios[ALL], found.nominal, atol=1e-6)
    assert found.advice == "no uncertainty is stated but the place of the palm in its plane"
    assert found.nominal > 40
    assert found.plain()["advice"] == found.advice


def test_a_palm_that_lies_aside_and_turned_is_told_and_no_distortion(focus) -> None:
    lab = NOTHING.but(palm_aside_mm=3.0, palm_turn_deg=5.0)
    free, fixed = loss(focus, lab), loss(focus, lab, fixed_place=True)
    np.testing.assert_allclose(free.ratios[ALL], free.nominal, atol=1e-6)
    assert np.median(fixed.ratios[ALL]) < fixed.nominal - 10
    assert free.place.startswith("4.2 mm, 5° off; people feel points")
    own = {"palm sideways", "palm rotation", ALL_FOLLOWED}
    assert (fixed.place, set(fixed.ratios) - set(free.ratios)) == ("", own)


def simulated(drive: Drive, lab: Laboratory, rng: np.random.Generator, *, supposed: bool) -> np.ndarray:
    """Pressure on the cells in the laboratory of these random numbers, 4 moments a frame, (moment, 2, 2).

    An own sum in double precision over other points: the palm is moved, not the array; cells are integrals of 1.5 mm.
    """
    stage = replace(_Stage.of(drive, SENSOR, GRID, None), supposed=supposed)
    air, pole = drive.acoustics.medium.warmer(rng.normal(0, lab.temperature_k)), TransducerDynamics().pole
    pose = _pose(lab, np.array([0, 0, 0.2]), rng)
    array = stage._array(lab, rng)
    k, factor = 2 * np.pi * array.frequency / air.speed, lab.reflection * np.exp(2j * np.pi * rng.random())

    def square(half: np.ndarray, step: float) -> np.ndarray:
        x, y = np.meshgrid(*(np.arange(-each + step / 2, each, step) for each in half))
        return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)

    def direct(points: np.ndarray) -> np.ndarray:
        away = points[:, None] - array.position
        far = np.linalg.norm(away, axis=2)
        angle = np.arccos((away * array.normal).sum(axis=2) / far)
        beam = off_axis(angle, "t4010a1", wavenumber=k) * array.pressure * array.response
        return beam * np.exp((1j * k - air.attenuation) * far) / far

    def radiated(to: np.ndarray, source: np.ndarray, normal: np.ndarray, step: float) -> np.ndarray:
        away = to[:, None] - source
        far = np.linalg.norm(away, axis=2)
        return step**2 * np.abs(away @ normal) * (1 / far - 1j * k) * np.exp(1j * k * far) / (2 * np.pi * far**2)

    flat, skin = square(np.full(2, 16.5e-3), 1.5e-3), square(np.full(2, 42e-3), 3e-3)
    skin = skin[np.hypot(*skin.T[:2]) < 42.5e-3]
    here, palm = (each @ pose.rotation[0].T + pose.centre[0] for each in (flat, skin))
    face = square(np.abs(drive.array.position[:, :2]).max(axis=0) + np.pi / k, 4e-3)
    back = radiated(face, palm, pose.normal[0], 3e-3) @ direct(palm)
    G = direct(here) + factor * radiated(here, face, np.array([0, 0, 1.0]), 4e-3) @ back
    command, now, field = drive.q @ G.T, drive.q[0] @ G.T, []
    for wanted in command:
        field += [wanted + (now - wanted) * np.exp(pole * part / 16e3) for part in (1, 2, 3, 4)]
        now = field[-1]
    # A box of 8 mm in a gel of 1 mm, on two axes.
    sides = [(flat[:, axis] - middle[:, None]) / 1e-3 for axis, middle in ((1, SENSOR.grid.y), (0, SENSOR.grid.x))]
    y, x = (scipy.stats.norm.cdf(each + 4) - scipy.stats.norm.cdf(each - 4) for each in sides)
    weights = np.einsum("rp,cp->rcp", y, x) * (1.5e-3 / 8e-3) ** 2
    return np.einsum("rcp,tp->trc", weights, radiation_pressure(np.array(field), air))


@pytest.mark.long
def test_each_laboratory_is_as_an_independent_simulation_has_it(focus) -> None:
    drive, asked = focus
    lab = Laboratory(palm_aside_mm=0.0, palm_turn_deg=0.0)
    found = loss(focus, lab).ratios
    for name in (ALL, ALL_MEASURED):
        for number, ratio in enumerate(found[name]):
            rng = np.random.default_rng([0, len(PARTS), number])
            own = replace(asked, pressure=simulated(drive, lab, rng, supposed=name != ALL), rate=16e3)
            judged = fidelity(asked, own, band=(20.0, 400.0), judged=(0.02, 0.08))
            assert ratio == pytest.approx(judged.overall_ratio, abs=1), (name, number)


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
    plain = {"response": np.ones(count, complex), "pole": np.full(count, -5000.0 + 0j), "dead": np.zeros(count, bool)}
    known = calibration(ARRAY, **plain, resonance_uncertainty=np.full(count, 1.0))
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
    wrong = {"palm_side_mm = 3": "palm_side_mm", "dead = 2.0": "dead: expected", "reflection = 'a'": "reflection"}
    for text, message in wrong.items():
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


@pytest.mark.long
def test_a_palm_held_higher_loses_less_by_its_height(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["record", "virtual:towel", "take.h5"]) == 0
    assert run(["doctor", "--lab", "lab.toml"]) == 0
    found = []
    for height in ("200mm", "300mm"):
        piece = ["--height", height, "--start-at", "0.4s", "--duration", "0.3s", "--json"]
        capsys.readouterr()
        assert run(["budget", "take.h5", "--lab", "lab.toml", *piece]) == 0
        found.append(json.loads(capsys.readouterr().out)["laboratory"])
    each, measured = ([one["uncertainties"][name] for one in found] for name in ("palm height", ALL_MEASURED))
    assert found[1]["nominal_db"] > found[0]["nominal_db"] - 1
    assert each[1]["median_db"] > each[0]["median_db"] + 1
    assert measured[1]["median_db"] > measured[0]["median_db"] + 1.5
    assert measured[1]["low_db"] > measured[0]["low_db"] + 3
    grids = (ControlGrid(rows=16, columns=16, pitch=11e-3 / 3, height=height) for height in (0.2, 0.3))
    low, high = (focus_amplitude(grid, TransducerArray.autd3(), acoustics=Acoustics()) for grid in grids)
    assert (high / low) ** 2 == pytest.approx(2 / 3, abs=0.02), "the greatest pressure"
