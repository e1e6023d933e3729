import numpy as np
import pytest

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Provenance, TransducerArray
from midair.physics import propagate
from midair.solve import solve

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
    from dataclasses import replace

    louder = replace(UNIT, pressure=2 * UNIT.pressure)
    one, two = solve(target(wave()), UNIT, iterations=10), solve(target(2 * wave()), louder, iterations=10)
    np.testing.assert_allclose(one.drive.phase, two.drive.phase, atol=1e-9)


@pytest.mark.parametrize(("iterations", "made"), [(3, [3, 3]), ((7, 2), [7, 2])])
def test_iterations_for_first_and_warm_frames(iterations, made):
    assert list(solve(target(wave(2)), UNIT, iterations=iterations).iterations) == made


def test_phases_are_within_a_turn_and_the_life_is_written_down():
    solution = solve(target(wave(), simulated=True), UNIT, iterations=5, directivity="point")
    assert solution.drive.phase.min() >= 0
    assert solution.drive.phase.max() < 2 * np.pi
    assert solution.drive.provenance.simulated
    step = solution.drive.provenance.steps[-1]
    assert step.stage == "solve"
    assert (step.settings["iterations"], step.settings["warm_iterations"]) == (5, 5)
    assert step.settings["directivity"] == "point"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "magic"}, "method: expected one of lm"),
        ({"start": "random"}, "start: expected previous or zero"),
        ({"level": 0.0}, "level: expected above 0"),
        ({"level": 1.5}, "level: expected above 0"),
        ({"bits": 0}, "bits: expected 1 to 16"),
        ({"iterations": 0}, "iterations: expected 1 or more"),
    ],
)
def test_wrong_settings_say_what_was_expected(options, message):
    with pytest.raises(InputError, match=message):
        solve(target(wave(1)), UNIT, **options)
