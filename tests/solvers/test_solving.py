from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import error_at_temperature
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, PressureFrames, Provenance, TransducerArray
from midair.physics import SensorModel, cell_weights, focus_amplitude, propagate, radiation_pressure
from midair.solvers import METHODS, Cells, Fast, Guard, solve, takes

SMALL = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
UNIT = TransducerArray.autd3(columns=1, rows=1)


def target(amplitude, grid=SMALL, simulated=False):
    return AmplitudeFrames(
        amplitude=np.asarray(amplitude, float), rate=500.0, grid=grid, provenance=Provenance(simulated=simulated)
    )


def wave(frames=4, points=16, pascal=3000.0):
    return pascal * np.random.default_rng(0).uniform(size=(frames, points))


@pytest.mark.parametrize("bits", [8, 4])
def test_rounded_phases_are_on_the_firmwares_grid_and_their_error_is_theirs(bits):
    wanted = target(wave())
    exact, rounded = solve(wanted, UNIT, iterations=15), solve(wanted, UNIT, iterations=15, bits=bits)
    steps = rounded.drive.phase / (2 * np.pi) * 2**bits
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    field = np.abs(propagate(rounded.drive, SMALL))
    expected = np.linalg.norm(field - wanted.amplitude, axis=1) / np.linalg.norm(wanted.amplitude, axis=1)
    np.testing.assert_allclose(rounded.error, expected, rtol=1e-9)
    assert (rounded.error > exact.error).all()


@pytest.mark.parametrize("level", [1.0, 0.4])
def test_the_error_is_that_of_the_drive_as_it_would_be_played(level):
    wanted = target(wave())
    solution = solve(wanted, UNIT, level=level, iterations=15)
    field = np.abs(propagate(solution.drive, SMALL))
    expected = np.linalg.norm(field - wanted.amplitude, axis=1) / np.linalg.norm(wanted.amplitude, axis=1)
    np.testing.assert_allclose(solution.error, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(solution.drive.level, np.full(4, level))
    assert solution.drive.rate == 500.0


def test_silent_frames_are_silent_and_keep_their_phases():
    amplitude = wave()
    amplitude[2] = 0
    solution = solve(target(amplitude), UNIT, iterations=5)
    assert solution.status[2] == "silent"
    assert solution.drive.level[2] == 0
    assert solution.error[2] == 0
    np.testing.assert_array_equal(solution.drive.phase[2], solution.drive.phase[1])


def test_the_unit_of_pressure_does_not_matter():
    """Twice the array's pressure and twice the target: the same phases."""

    louder = replace(UNIT, pressure=2 * UNIT.pressure)
    one, two = solve(target(wave()), UNIT, iterations=10), solve(target(2 * wave()), louder, iterations=10)
    np.testing.assert_allclose(one.drive.phase, two.drive.phase, atol=1e-9)


@pytest.mark.parametrize(("iterations", "made"), [(3, [3, 3]), ((7, 2), [7, 2])])
def test_iterations_for_first_and_warm_frames(iterations, made):
    assert list(solve(target(wave(2)), UNIT, iterations=iterations).iterations) == made


def test_phases_are_within_a_turn_and_the_life_is_written_down():
    solution = solve(target(wave(), simulated=True), UNIT, iterations=5, acoustics=Acoustics(directivity="point"))
    assert solution.drive.phase.min() >= 0
    assert solution.drive.phase.max() < 2 * np.pi
    assert solution.drive.provenance.simulated
    step = solution.drive.provenance.steps[-1]
    assert step.stage == "solve"
    assert (step.settings["iterations"], step.settings["warm_iterations"]) == (5, 5)
    assert step.settings["directivity"] == "point"


@pytest.mark.parametrize("method", ["lm", "fast"])
def test_bounded_amplitudes_differ_between_transducers_and_the_error_includes_them(method):
    wanted = target(wave(pascal=700.0))
    solution = solve(wanted, UNIT, method=method, amplitudes="bounded", level=0.5, bits=8)
    level = solution.drive.level
    assert level.shape == (4, UNIT.count)
    assert 0 <= level.min() < 0.4
    assert 0.4 < level.max() <= 0.5
    field = np.abs(propagate(solution.drive, SMALL))
    expected = np.linalg.norm(field - wanted.amplitude, axis=1) / np.linalg.norm(wanted.amplitude, axis=1)
    np.testing.assert_allclose(solution.error, expected, rtol=1e-4)


def test_silent_frames_of_bounded_amplitudes_are_silent():
    amplitude = wave()
    amplitude[1] = 0
    level = solve(target(amplitude), UNIT, method="fast", amplitudes="bounded").drive.level
    assert not level[1].any()
    assert level[[0, 2, 3]].any(axis=1).all()


def test_an_automatic_level_is_ten_times_the_strength():
    focus = focus_amplitude(SMALL, UNIT)
    amplitude = np.array([np.full(16, 0.02), np.full(16, 0.03)]) * focus
    solution = solve(target(amplitude), UNIT, method="fast", level="auto")
    np.testing.assert_allclose(solution.drive.level, 0.3)
    assert solution.drive.provenance.steps[-1].settings["level"] == pytest.approx(0.3)


@pytest.mark.parametrize("method", ["lm", "fast"])
def test_a_guard_makes_the_ring_quieter(method):
    grid = ControlGrid(rows=5, columns=5, pitch=5e-3, height=0.1)
    wanted, guard = target(wave(3, 25, 1500.0), grid), Guard(margin=15e-3, pitch=5e-3, ceiling=0.3)
    free, kept = (solve(wanted, UNIT, method=method, guard=g) for g in (None, guard))
    ring = guard.points(grid)
    before, after = (
        np.abs(propagate(one.drive, ring)).max(axis=1) / wanted.amplitude.max(axis=1) for one in (free, kept)
    )
    assert (after < before).all()
    assert after.max() < 0.45 < before.max()
    assert kept.drive.provenance.steps[-1].settings["guard_margin"] == 15e-3


@pytest.mark.parametrize(("precision", "rounding"), [("double", 1e-13), ("single", 4 * np.finfo(np.float32).eps)])
def test_cells_read_the_target_pressure(precision, rounding):
    """In Pa: the sensor's weights times the pressure of the propagated field, whose rounding is absolute in E."""
    grid, asked = ControlGrid(height=0.1), np.random.default_rng(1).uniform(2, 6, (2, 4, 4))
    pressure = PressureFrames(pressure=asked, rate=500.0)
    wanted = target(np.full((2, grid.count), 1000.0), grid)
    solution = solve(wanted, UNIT, method=Fast(precision=precision), fit=Cells(pressure=pressure))
    pushed = radiation_pressure(propagate(solution.drive, grid), Medium())
    read = pushed @ cell_weights(SensorModel(), grid, between="waves").T
    missed = np.linalg.norm(read - asked.reshape(2, 16), axis=1) / np.linalg.norm(asked.reshape(2, 16), axis=1)
    np.testing.assert_allclose(solution.error, missed, rtol=0, atol=rounding)
    assert missed.max() < 0.05


def test_settings_are_in_the_provenance():
    solution = solve(target(wave()), UNIT, method="fast", fit="cells", smooth=0.01, amplitudes="bounded")
    settings = solution.drive.provenance.steps[-1].settings
    assert (settings["fit"], settings["smooth"], settings["amplitudes"]) == ("cells", 0.01, "bounded")


ROOM = Acoustics(medium=Medium.at(temperature=22.0))


def over_the_range(solution, wanted):
    """Mean E at 19 to 25 degrees."""
    return np.array(
        [error_at_temperature(solution.drive, wanted, ROOM.medium.warmer(by)).mean() for by in (-3, -1.5, 0, 1.5, 3)]
    )


@pytest.mark.long
@pytest.mark.parametrize("method", [method for method in METHODS if "robust" in takes(method)])
@pytest.mark.parametrize("amplitudes", ["equal", "bounded"])
def test_robust_phases_hold_over_the_range(method, amplitudes):
    """At both ends E is smaller than that of phases for the middle, and so is the root mean square over the range."""
    if method == "live":
        pytest.importorskip("numba")
    if method == "free" and amplitudes == "bounded":
        pytest.skip("its amplitudes are free already")
    array, grid = TransducerArray.autd3(columns=2, rows=1), ControlGrid(rows=8, columns=8, pitch=7e-3)
    wanted = target(300 * np.abs(np.sin(0.3 * np.arange(64) + np.arange(3)[:, None])), grid)
    plain, robust = (
        solve(wanted, array, method=method, acoustics=ROOM, amplitudes=amplitudes, robust=by) for by in (0.0, 3.0)
    )
    before, after = over_the_range(plain, wanted), over_the_range(robust, wanted)
    assert (after[[0, 4]] < 0.9 * before[[0, 4]]).all()
    assert (after**2).sum() < 0.8 * (before**2).sum()
    # E is reported in single precision.
    assert robust.error.mean() == pytest.approx(after[2], rel=1e-4)
    assert robust.drive.acoustics == ROOM


@pytest.mark.parametrize("term", [{"guard": 0.014}, {"smooth": 0.01}, {"level": "auto"}], ids=str)
def test_robust_goes_with_every_other_term(term):
    wanted = target(wave(frames=3, points=64, pascal=900.0), ControlGrid(rows=8, columns=8, pitch=7e-3))
    solution = solve(wanted, UNIT, method="fast", acoustics=ROOM, robust=2.0, **term)
    assert solution.error.max() < 1
    assert solution.drive.provenance.steps[-1].settings["robust_c"] == 2.0
