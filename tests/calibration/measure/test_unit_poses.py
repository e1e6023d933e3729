from dataclasses import replace

import numpy as np
import pytest
from benchmarks.unknown_arrays import measured as unknown_array
from scipy.spatial.transform import Rotation

from midair.calibration import ArrayField, ArrayPlan, SensorPlace, TransducerPrior, array_codes, check_array, fit_array
from midair.calibration.measure.group_fit import ArrayState, GroupFit, predicted_spectrum, real_parts
from midair.calibration.measure.unit_poses import columns_of_units, differences, moved_array
from midair.model import POSE_AIMS, Acoustics, ArrayCalibration, ControlGrid, Drive, Medium, TransducerArray
from midair.physics import (
    PlaybackChain,
    SensorModel,
    TransducerDynamics,
    Transducers,
    calibration_of,
    cell_weights,
    sense,
    simulate,
    transfer_matrix,
)

ROOM = Acoustics(medium=Medium.at(temperature=22.0, humidity=0.5))
WHOLE = TransducerArray.autd3()


def some(each):
    """`each` transducers of every unit, nearest to the centre."""
    far = np.linalg.norm(WHOLE.position, axis=1)
    near = np.sort(
        np.concatenate([np.flatnonzero(WHOLE.unit == u)[np.argsort(far[WHOLE.unit == u])[:each]] for u in range(4)])
    )
    return TransducerArray(position=WHOLE.position[near], normal=WHOLE.normal[near], unit=WHOLE.unit[near], name="some")


@pytest.mark.long
def test_the_jacobian_is_that_of_the_model():
    array, model = some(6), SensorModel()
    codes = array_codes(array, model.grid, ArrayPlan(duration=0.3, group=12), acoustics=ROOM, height=0.2)
    field = ArrayField(array=array, codes=codes, acoustics=ROOM, calibration=calibration_of(model))
    rng, pole = np.random.default_rng(0), np.full(24, TransducerDynamics().pole)
    response = (1 + 0.1 * rng.standard_normal(24)) * np.exp(0.3j * rng.standard_normal(24))
    state = ArrayState(response, pole, SensorPlace(x=1e-3, turn=0.02))
    now = predicted_spectrum(field, 0, state)
    known = {"usual": TransducerPrior(), "strength": 1.0, "centre": np.ones(24, complex), "pole": pole}
    fit = GroupFit(field=field, measured=[now], state=state, slopes=[], **known)
    fit.slopes = [fit.slope(0)]
    found = columns_of_units(fit, 0, np.ones(28), np.zeros((24, 28)))
    for column, step in enumerate(np.tile(POSE_AIMS / 100, 4)):
        pose = np.zeros(28)
        pose[column] = step
        pose = pose.reshape(4, 7)
        late = np.exp(2j * np.pi * 40e3 * pose[array.unit, 6])
        changed = predicted_spectrum(
            replace(field, array=moved_array(array, pose)), 0, ArrayState(response * late, pole, state.place)
        )
        true = np.concatenate([real_parts(cell) for cell in (changed - now).T]) / step
        # The coded transducers change the beam itself a little.
        assert np.linalg.norm(found[:, column] - true) < 0.03 * np.linalg.norm(true)
    # Far from the minimum a full step of a pole would overshoot.
    fit.measured, first = [20 * now], pole.copy()
    fit.step(0)
    assert np.abs(state.pole - first).max() == pytest.approx(0.3 * abs(first[0].real))


def test_the_motion_of_the_whole_array_is_no_difference():
    turn, middle = Rotation.from_rotvec([1e-3, -2e-3, 3e-3]), WHOLE.position.mean(0)
    moved = turn.apply(WHOLE.position - middle) + middle + np.array([1e-3, 2e-3, -1e-3])
    pose = np.zeros((4, 7))
    for unit in range(4):
        own = WHOLE.unit == unit
        pose[unit, :3] = (moved - WHOLE.position)[own].mean(axis=0)
    pose[:, 3:6], pose[:, 6] = turn.as_rotvec(), 2e-7
    np.testing.assert_allclose(moved_array(WHOLE, pose).position, moved, atol=1e-9)
    left, _ = differences(WHOLE, pose, np.eye(28))
    assert np.abs(left / POSE_AIMS).max() < 0.01


def measured(array, secret, pose, *, seed=0, plan=None, noise=1e-6, away=(0.0, 0.0, 0.2), known=None, jump=None):
    """Calibrate, or check against `known`, an array whose units are at `pose`; `jump` moves the sensor before the last
    group.
    """
    model = SensorModel(noise=noise, bits=32).with_spread(seed=seed)
    codes = array_codes(array, model.grid, plan or ArrayPlan(duration=1.0, group=60), acoustics=ROOM, height=0.2)
    drive = Drive(phase=codes.phase, level=np.full(codes.frames, codes.level), rate=1000, array=array, acoustics=ROOM)
    late = np.exp(2j * np.pi * 40e3 * pose[array.unit, 6])

    def pressed(away):
        points = ControlGrid(rows=16, columns=16, pitch=1.6e-3, height=away[2], centre=away[:2])
        return simulate(
            drive,
            transfer_matrix(points, moved_array(array, pose), acoustics=ROOM),
            chain=PlaybackChain(transducers=replace(secret, response=secret.response * late), precision="double"),
            rate=8000,
            weights=cell_weights(model, points, centre=away[:2], between="waves"),
        ).reshape(-1, 4, 4)

    felt = pressed(away)
    if jump is not None:
        before = 8 * (codes.starts[-1] - codes.settle // 2)
        felt = np.concatenate([felt[:before], pressed(tuple(np.add(away, jump)))[before:]])
    felt = np.concatenate([felt, np.repeat(felt[-1:], 400, axis=0)])
    volts = sense(model, felt, 1000, rng=np.random.default_rng(seed), oversample=8).reshape(-1, 16)
    field = ArrayField(array=array, codes=codes, acoustics=ROOM, calibration=calibration_of(model))
    return fit_array(field, volts) if known is None else check_array(field, volts, known)


@pytest.fixture(scope="module")
def case():
    array, rng = some(30), np.random.default_rng(5)
    secret = Transducers.varied(
        array.count, seed=3, gain=0.9, gain_spread=0.1, resonance_spread=100, quality_spread=0.05
    )
    pose = np.array([*[0.4e-3] * 3, *np.radians([0.2] * 3), 300e-9]) * rng.standard_normal((4, 7))
    return array, secret, pose, measured(array, secret, pose)


@pytest.mark.long
def test_units_out_of_place_are_found(case):
    array, _, pose, found = case
    true, _ = differences(array, pose, np.zeros((28, 28)))
    off = np.abs(found.pose - true)
    # The fit and this simulation average over the cells on different points, which the noise does not cover.
    assert (off / found.pose_uncertainty).max() < 6
    assert off[:, :2].max() < 0.1e-3 < np.abs(true[:, :2]).max()
    assert off[:, 3:6].max() < np.radians(0.4)
    # A delay looks like a height.
    assert any("z" in names and "time offset" in names for names in found.inseparable())


@pytest.mark.long
def test_a_check_names_what_changed_and_nothing_else(case):
    array, secret, pose, known = case
    plan = ArrayPlan(duration=0.5, group=60)
    aside = (0.4e-3, -0.3e-3, 0.2003)
    assert measured(array, secret, pose, seed=1, plan=plan, away=aside, known=known).problems() == []
    late, dead = pose.copy(), secret.response.copy()
    late[2, 6] += 400e-9
    dead[[7, 70]] = 0
    out = measured(array, secret, late, seed=1, plan=plan, known=known)
    assert out.offset[2] - np.delete(out.offset, 2).mean() == pytest.approx(400e-9, abs=100e-9)
    assert any("unit 2" in line for line in out.problems())
    gone = measured(array, replace(secret, response=dead), pose, seed=1, plan=plan, known=known)
    np.testing.assert_array_equal(gone.dead, [7, 70])
    assert any("2 transducers silent: 7, 70" in line for line in gone.problems())


def test_what_cannot_be_told_apart_is_said_in_words():
    array = some(2)
    numbers = {f"{name}_uncertainty": np.ones(8) for name in ("strength", "phase", "resonance", "quality")}
    covariance = np.diag(np.tile((0.1 * POSE_AIMS) ** 2, 4))
    direction = np.zeros(28)
    direction[[2, 6]] = 3 * POSE_AIMS[[2, 6]]
    numbers |= {"response": np.ones(8), "pole": np.full(8, -5000 + 0j), "dead": np.zeros(8, bool)}
    known = ArrayCalibration(array=array, pose_covariance=covariance + np.outer(direction, direction), **numbers)
    assert list(known.inseparable()) == ["z and time offset"]
    assert known.inseparable()["z and time offset"] == pytest.approx(np.sqrt(18), rel=0.01)


@pytest.mark.slow
def test_units_of_an_array_that_the_method_does_not_expect():
    """996 transducers of a wide spread from another forward model; fits that end beside the minimum show only here."""
    _, scores = unknown_array(3, 4.0)
    for name, aim in (("x and y of units, mm", 0.1), ("z of units, mm", 0.1), ("angles of units, deg", 0.1)):
        error, uncertainty = scores[name]
        assert np.sqrt(np.mean(error**2)) < aim
        assert np.sqrt(np.mean((error / uncertainty) ** 2)) < 1.5
