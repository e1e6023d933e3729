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


def missed(drive, wanted):
    """E of each frame from the field of the drive."""
    field = np.abs(propagate(drive, SMALL))
    return np.linalg.norm(field - wanted.amplitude, axis=1) / np.linalg.norm(wanted.amplitude, axis=1)


def test_the_error_is_that_of_the_drive_as_it_would_be_played_also_of_phases_on_the_firmwares_grid():
    wanted = target(wave())
    for level in (0.4, 1.0):
        exact = solve(wanted, UNIT, level=level, iterations=15)
        np.testing.assert_allclose(exact.error, missed(exact.drive, wanted), rtol=1e-9, atol=1e-12, err_msg=str(level))
        np.testing.assert_array_equal(exact.drive.level, np.full(4, level))
        assert exact.drive.rate == 500.0
    for bits in (8, 4):
        rounded = solve(wanted, UNIT, iterations=15, bits=bits)
        steps = rounded.drive.phase / (2 * np.pi) * 2**bits
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9, err_msg=str(bits))
        np.testing.assert_allclose(rounded.error, missed(rounded.drive, wanted), rtol=1e-9, err_msg=str(bits))
        assert (rounded.error > exact.error).all(), bits


def test_silent_frames_are_silent_and_keep_their_phases():
    amplitude = wave()
    amplitude[2] = 0
    solution = solve(target(amplitude), UNIT, iterations=5)
    assert (solution.status[2], solution.drive.level[2], solution.error[2]) == ("silent", 0, 0)
    np.testing.assert_array_equal(solution.drive.phase[2], solution.drive.phase[1])
    level = solve(target(amplitude), UNIT, method="fast", amplitudes="bounded").drive.level
    np.testing.assert_array_equal(level.any(axis=1), [True, True, False, True])


def test_the_unit_of_pressure_does_not_matter():
    """Twice the array's pressure and twice the target: the same phases."""
    louder = replace(UNIT, pressure=2 * UNIT.pressure)
    one, two = solve(target(wave()), UNIT, iterations=10), solve(target(2 * wave()), louder, iterations=10)
    np.testing.assert_allclose(one.drive.phase, two.drive.phase, atol=1e-9)


def test_iterations_and_an_automatic_level_of_ten_times_the_strength():
    for iterations, made in ((3, [3, 3]), ((7, 2), [7, 2])):
        assert list(solve(target(wave(2)), UNIT, iterations=iterations).iterations) == made, iterations
    focus = focus_amplitude(SMALL, UNIT)
    amplitude = np.array([np.full(16, 0.02), np.full(16, 0.03)]) * focus
    solution = solve(target(amplitude), UNIT, method="fast", level="auto")
    np.testing.assert_allclose(solution.drive.level, 0.3)
    assert solution.drive.provenance.steps[-1].settings["level"] == pytest.approx(0.3)


def test_phases_are_within_a_turn_and_the_life_is_written_down():
    solution = solve(target(wave(), simulated=True), UNIT, iterations=5, acoustics=Acoustics(directivity="point"))
    assert solution.drive.phase.min() >= 0
    assert solution.drive.phase.max() < 2 * np.pi
    assert solution.drive.provenance.simulated
    step = solution.drive.provenance.steps[-1]
    assert step.stage == "solve"
    assert (step.settings["iterations"], step.settings["warm_iterations"]) == (5, 5)
    assert step.settings["directivity"] == "point"
    solution = solve(target(wave()), UNIT, method="fast", fit="cells", smooth=0.01, amplitudes="bounded")
    settings = solution.drive.provenance.steps[-1].settings
    assert (settings["fit"], settings["smooth"], settings["amplitudes"]) == ("cells", 0.01, "bounded")


def test_bounded_amplitudes_differ_between_transducers_and_the_error_includes_them():
    wanted = target(wave(pascal=700.0))
    for method in ("lm", "fast"):
        solution = solve(wanted, UNIT, method=method, amplitudes="bounded", level=0.5, bits=8)
        level = solution.drive.level
        assert level.shape == (4, UNIT.count), method
        assert 0 <= level.min() < 0.4 < level.max() <= 0.5, method
        np.testing.assert_allclose(solution.error, missed(solution.drive, wanted), rtol=1e-4, err_msg=method)


def test_a_guard_makes_the_ring_quieter():
    grid = ControlGrid(rows=5, columns=5, pitch=5e-3, height=0.1)
    wanted, guard = target(wave(3, 25, 1500.0), grid), Guard(margin=15e-3, pitch=5e-3, ceiling=0.3)
    for method in ("lm", "fast"):
        free, kept = (solve(wanted, UNIT, method=method, guard=g).drive for g in (None, guard))
        before, after = (np.abs(propagate(one, guard.points(grid))).max(axis=1) for one in (free, kept))
        assert (after < before).all(), method
        before, after = (each / wanted.amplitude.max(axis=1) for each in (before, after))
        assert after.max() < 0.45 < before.max(), method
        assert kept.provenance.steps[-1].settings["guard_margin"] == 15e-3


def test_cells_read_the_target_pressure():
    """In Pa: the sensor's weights times the pressure of the propagated field, whose rounding is absolute in E."""
    grid, asked = ControlGrid(height=0.1), np.random.default_rng(1).uniform(2, 6, (2, 4, 4))
    wanted, cells = target(np.full((2, grid.count), 1000.0), grid), asked.reshape(2, 16)
    for precision, rounding in (("double", 1e-13), ("single", 4 * np.finfo(np.float32).eps)):
        fit = Cells(pressure=PressureFrames(pressure=asked, rate=500.0))
        solution = solve(wanted, UNIT, method=Fast(precision=precision), fit=fit)
        pushed = radiation_pressure(propagate(solution.drive, grid), Medium())
        read = pushed @ cell_weights(SensorModel(), grid, between="waves").T
        off = np.linalg.norm(read - cells, axis=1) / np.linalg.norm(cells, axis=1)
        np.testing.assert_allclose(solution.error, off, rtol=0, atol=rounding, err_msg=precision)
        assert off.max() < 0.05, precision


ROOM = Acoustics(medium=Medium.at(temperature=22.0))


def over_the_range(solution, wanted):
    """Mean E at 19 to 25 degrees."""
    return np.array(
        [error_at_temperature(solution.drive, wanted, ROOM.medium.warmer(by)).mean() for by in (-3, -1.5, 0, 1.5, 3)]
    )


@pytest.mark.long
def test_robust_phases_hold_over_the_range(subtests):
    """At both ends E is smaller than that of phases for the middle, and so is the root mean square over the range."""
    pytest.importorskip("numba")
    array, grid = TransducerArray.autd3(columns=2, rows=1), ControlGrid(rows=8, columns=8, pitch=7e-3)
    wanted = target(300 * np.abs(np.sin(0.3 * np.arange(64) + np.arange(3)[:, None])), grid)
    methods = [method for method in METHODS if "robust" in takes(method)]
    for how in ({"method": method, "amplitudes": each} for method in methods for each in ("equal", "bounded")):
        if how == {"method": "free", "amplitudes": "bounded"}:
            continue  # its amplitudes are free already
        with subtests.test(**how):
            plain, robust = (solve(wanted, array, acoustics=ROOM, robust=by, **how) for by in (0.0, 3.0))
            before, after = over_the_range(plain, wanted), over_the_range(robust, wanted)
            assert (after[[0, 4]] < 0.9 * before[[0, 4]]).all()
            assert (after**2).sum() < 0.8 * (before**2).sum()
            # E is reported in single precision.
            assert robust.error.mean() == pytest.approx(after[2], rel=1e-4)
            assert robust.drive.acoustics == ROOM


def test_robust_goes_with_every_other_term():
    wanted = target(wave(frames=3, points=64, pascal=900.0), ControlGrid(rows=8, columns=8, pitch=7e-3))
    for term in ({"guard": 0.014}, {"smooth": 0.01}, {"level": "auto"}):
        solution = solve(wanted, UNIT, method="fast", acoustics=ROOM, robust=2.0, **term)
        assert solution.error.max() < 1, term
        assert solution.drive.provenance.steps[-1].settings["robust_c"] == 2.0, term
