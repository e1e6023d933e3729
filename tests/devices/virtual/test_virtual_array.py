from dataclasses import replace

import numpy as np
import pytest
from tests.model.test_calibration import calibration
from tests.palms import palm_path
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import VirtualArray, VirtualSkin, usual_transducers
from midair.errors import InputError, RateError
from midair.evaluate import error_at_temperature
from midair.model import (
    HEIGHT,
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Drive,
    Medium,
    Palm,
    PressureFrames,
    Provenance,
    SensorGrid,
    TransducerArray,
)
from midair.physics import (
    PlaybackChain,
    SensorModel,
    Transducers,
    cell_weights,
    echo_matrix,
    focus_phase,
    middle_of,
    on_the_palm,
    radiation_pressure,
    relative_error,
    simulate,
    sound_amplitude,
    transfer_matrix,
)
from midair.rig.names.array_names import KeptCalibration
from midair.settings import Settings
from midair.solvers import solve

ARRAY = TransducerArray.autd3(columns=1, rows=1)
PERFECT = {"chain": PlaybackChain(transducers=Transducers.alike(249))}
WEAKER = {"chain": PlaybackChain(transducers=Transducers.varied(249, seed=0, gain=0.9))}
EXACT = {"chain": PlaybackChain(phase_bits=None, precision="double", transducers=Transducers.alike(249))}


def drawn(seed):
    return PlaybackChain(transducers=usual_transducers(249, seed=seed))


def focus(frames=20, level=0.2, rate=1000.0):
    phase = np.broadcast_to(focus_phase(ARRAY, np.array([0, 0, 0.2])), (frames, ARRAY.count))
    return Drive(phase=phase, level=np.full(frames, level), rate=rate, array=ARRAY)


def felt(skin):
    return np.asarray(skin.pressure(0))


def steady(level=0.2, **options):
    skin = VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, skin, **options) as array:
        array.play(clear_any_exposure(focus(level=level), array))
    return felt(skin)[-1]


def test_the_echo_of_the_array_s_face_presses_too():
    """Weights of the cells times the radiation pressure of (G + R E) q, with points 3 mm apart on the palm."""
    skin, q = VirtualSkin(SensorModel()), 0.2 * np.exp(1j * focus().phase[0])
    palm, area = Palm.disc(pitch=3e-3).points(np.array([0, 0, 0.2])), 9e-6 * np.array([0, 0, 1.0])
    field = transfer_matrix(skin.points, ARRAY) + 0.9j * echo_matrix(skin.points.position, palm, ARRAY, area=area)
    expected = cell_weights(skin.model, skin.points, between="waves") @ radiation_pressure(field @ q, Medium())
    found = steady(**EXACT, reflection=0.9j).ravel()
    np.testing.assert_allclose(found, expected, atol=0.01 * expected.max())
    assert np.abs(found - steady(**EXACT).ravel()).max() > 0.05 * expected.max()
    with pytest.raises(InputError, match="a palm at rest under an echo"):
        steady(**EXACT, reflection=0.5, palm=palm_at((0, 0, 0.2)))


@pytest.mark.long
def test_a_steady_focus_presses_as_the_field_says():
    """In closed form: weights of the cells times the radiation pressure of G q at the skin's points."""
    skin = VirtualSkin(SensorModel())
    q = 0.2 * np.exp(1j * focus().phase[0])
    field = transfer_matrix(skin.points, ARRAY) @ q
    expected = cell_weights(skin.model, skin.points, between="waves") @ radiation_pressure(field, Medium())
    np.testing.assert_allclose(steady(**EXACT).ravel(), expected, rtol=1e-6)
    # in single precision and with 8 bits: .007 rad rms of rounding on 249 transducers is 1e-3 of pressure
    np.testing.assert_allclose(steady(**PERFECT).ravel(), expected, atol=4e-3 * expected.max())


def palm_at(*centres, tilt=0.0):
    """A palm at these places, 10 ms apart."""
    return palm_path(0.01 * np.arange(len(centres)), np.array(centres), tilt=tilt)


@pytest.mark.long
def test_a_palm_that_lies_elsewhere_feels_the_field_there():
    """In closed form as above, at the points of the moved skin; a palm in its solved place changes nothing."""
    at_rest = steady(**EXACT)
    np.testing.assert_allclose(steady(**EXACT, palm=palm_at((0, 0, HEIGHT))), at_rest, rtol=1e-6)
    skin, palm = VirtualSkin(SensorModel()), palm_at((4e-3, 0, 0.203), (4e-3, 0, 0.203), tilt=0.1)
    points = on_the_palm(skin.points.position, middle_of(skin.points), palm)[0]
    field = transfer_matrix(points, ARRAY) @ (0.2 * np.exp(1j * focus().phase[0]))
    expected = cell_weights(skin.model, skin.points, between="waves") @ radiation_pressure(field, Medium())
    np.testing.assert_allclose(steady(**EXACT, palm=palm).ravel(), expected, rtol=1e-6)


@pytest.mark.long
def test_a_moving_palm_begins_anew_with_each_play():
    """Time 0 is the first frame of a play; repeats go on."""
    skin, found = VirtualSkin(SensorModel()), []
    away = palm_at((0, 0, HEIGHT), (8e-3, 0, HEIGHT), (20e-3, 0, HEIGHT))
    with VirtualArray(ARRAY, skin, **EXACT, palm=away) as array:
        for repeats in (1, 2):
            skin.clear()
            array.play(clear_any_exposure(focus(frames=12), array, repeats=repeats))
            found.append(felt(skin))
    assert np.array_equal(found[0], found[1][: len(found[0])])
    strongest = found[1].max(axis=1).argmax(axis=1)
    assert (strongest[90], strongest[-1]) == (strongest[0], 0)


class Points(VirtualSkin):
    """Measures the control points themselves, without gel and cells."""

    def __init__(self, points):
        super().__init__(SensorModel())
        self.points, self.felt = points, []

    def press(self, pressure):
        self.felt.append(pressure)


def error_at_play(solution, target, room, **options):
    """E of each frame from the pressure of an ideal array in the room's air, at the frame's first moment."""
    points, chain = Points(target.grid), PlaybackChain(phase_bits=None, hold="ideal", precision="double")
    with VirtualArray(ARRAY, points, acoustics=room, chain=chain, **options) as array:
        array.play(clear_any_exposure(solution.drive, array))
    medium = (room or solution.drive.acoustics).medium
    wanted = radiation_pressure(target.amplitude, solution.drive.acoustics.medium)
    found = sound_amplitude(np.concatenate(points.felt)[::8], medium)
    return relative_error(found, sound_amplitude(wanted, medium))


@pytest.fixture(scope="module")
def warm():
    grid = ControlGrid(rows=12, columns=12, pitch=5e-3, height=0.15)
    amplitude = 400.0 * np.random.default_rng(0).random((5, grid.count))
    target = AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=grid)
    air = Acoustics(medium=Medium.at(temperature=26.0, humidity=0.3))
    return solve(target, ARRAY, method="fast", acoustics=air), target


def test_the_error_at_play_is_the_solver_s_and_in_another_air_what_error_in_air_says(warm):
    solution, target = warm
    np.testing.assert_allclose(error_at_play(solution, target, None), solution.error, rtol=1e-4)
    np.testing.assert_allclose(error_at_play(solution, target, solution.drive.acoustics), solution.error, rtol=1e-4)
    cold = Acoustics()
    found = error_at_play(solution, target, cold)
    assert found.min() > solution.error.max()
    np.testing.assert_allclose(found, error_at_temperature(solution.drive, target, cold.medium), rtol=1e-4)


def test_a_known_reflection_is_solved_for_as_far_as_the_height_is_known(warm):
    plain, target = warm
    none = {f"{name}_uncertainty": np.zeros(249) for name in ("strength", "phase", "resonance", "quality")}
    none |= {"response": np.ones(249), "pole": EXACT["chain"].transducers.pole, "dead": np.zeros(249, bool)}
    known = calibration(ARRAY, reflection=0.5, **none)
    asked = PressureFrames(pressure=np.ones((5, 4, 4)), rate=1000.0, sensor=SensorGrid(), provenance=Provenance())
    errors = [error_at_play(plain, target, None, reflection=0.5)]
    for uncertainty in (Settings().target.height_uncertainty, 0.5e-3, 0.0):
        settings = Settings().but(height_uncertainty=uncertainty)
        array, _, _ = KeptCalibration(known=known).applied(ARRAY, settings, asked)
        assert array.reflection == pytest.approx({3e-3: 0.0, 0.5e-3: 0.385, 0.0: 0.5}[uncertainty], abs=5e-3)
        solved = solve(target, array, method="fast", acoustics=plain.drive.acoustics)
        errors.append(error_at_play(solved, target, None, reflection=0.5))
    np.testing.assert_allclose(errors[1], errors[0], rtol=1e-6)
    assert (errors[2] < 0.8 * errors[0]).all()
    assert (errors[3] < 0.7 * errors[0]).all()


def test_an_array_of_no_stated_air_takes_that_of_each_drive(warm):
    """A focus for 26 degrees and one for 14, on one array: each pressure equals that of its own field."""
    skin = VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, skin, **EXACT) as array:
        for air in (warm[0].drive.acoustics, Acoustics()):
            drive = replace(focus(), acoustics=air)
            skin.clear()
            array.play(clear_any_exposure(drive, array))
            field = transfer_matrix(skin.points, ARRAY, acoustics=air) @ drive.q[-1]
            expected = cell_weights(skin.model, skin.points, between="waves") @ radiation_pressure(field, air.medium)
            np.testing.assert_allclose(felt(skin)[-1].ravel(), expected, rtol=1e-6)


@pytest.mark.long
def test_pressure_goes_with_the_square_of_level_and_strength_and_a_seed_is_an_array():
    np.testing.assert_allclose(steady(level=0.4, **EXACT), 4 * steady(level=0.2, **EXACT), rtol=1e-9)
    np.testing.assert_allclose(steady(level=0.4, **PERFECT), 4 * steady(level=0.2, **PERFECT), rtol=1e-5)
    np.testing.assert_allclose(steady(**WEAKER), 0.81 * steady(**PERFECT), rtol=1e-5)
    first, again, other = (steady(chain=drawn(seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_transducers_take_their_time():
    """After one time constant the envelope is 1 - 1/e of a step at zero detuning; the pressure is its square."""
    skin = VirtualSkin(SensorModel(), rate=8000.0)
    with VirtualArray(ARRAY, skin, **PERFECT) as array:
        array.play(clear_any_exposure(focus(), array))
    rise = felt(skin)[:, 1, 1] / felt(skin)[-1, 1, 1]
    gone = np.exp((-1 / 188e-6 + 2j * np.pi * 205) * np.arange(1, 9) / 8000)
    np.testing.assert_allclose(rise[:8], np.abs(1 - gone) ** 2, rtol=1e-3)


@pytest.mark.long
def test_blocks_of_a_long_drive_join_without_a_seam():
    long, short = VirtualSkin(SensorModel()), VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, long) as array:
        array.play(clear_any_exposure(focus(frames=300), array))
    with VirtualArray(ARRAY, short) as array:
        array.play(clear_any_exposure(focus(frames=5), array))
    np.testing.assert_allclose(felt(long)[40:], np.broadcast_to(felt(long)[-1], (2360, 4, 4)), rtol=0.02)
    np.testing.assert_allclose(felt(long)[:40], felt(short), rtol=1e-5)


def test_a_rate_that_does_not_fit_is_refused():
    with VirtualArray(ARRAY, VirtualSkin(SensorModel())) as array, pytest.raises(RateError, match="whole multiple"):
        array.play(clear_any_exposure(focus(rate=3000.0), array))


def wandering(frames=60):
    step = np.random.default_rng(5).uniform(-2, 2, (frames, ARRAY.count))
    return Drive(phase=np.cumsum(step, axis=0), level=np.full(frames, 0.5), rate=1000.0, array=ARRAY)


def test_plays_what_the_simulation_says():
    """Blocks of a device compared with one call of the simulation, with transducers that differ."""
    skin = VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, skin, chain=drawn(4)) as array:
        array.play(clear_any_exposure(wandering(200), array))
    G = transfer_matrix(skin.points, ARRAY)
    weights = cell_weights(skin.model, skin.points, between="waves")
    law = simulate(wandering(200), G, chain=array.chain, rate=8000.0, weights=weights)
    np.testing.assert_allclose(felt(skin).reshape(-1, 16), law, atol=1e-5 * law.max())


@pytest.mark.long
def test_a_silencer_is_simulated_and_reported():
    """For a focus that moves in jumps, half a frame of silencer weakens the pressure."""
    off, half = VirtualSkin(SensorModel()), VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, off) as array:
        assert array.play(clear_any_exposure(wandering(), array)).silencer == "off"
    with VirtualArray(ARRAY, half, silencer="half") as array:
        report = array.play(clear_any_exposure(wandering(), array))
    assert report.silencer == "phase 0.5 ms, intensity 0.25 ms"
    assert np.abs(felt(half) - felt(off)).max() > 0.05 * felt(off).max()


def test_an_ideal_hold_presses_the_quasi_stationary_field_at_the_beginning_of_each_frame():
    skin = VirtualSkin(SensorModel())
    with VirtualArray(ARRAY, skin, chain=PlaybackChain(hold="ideal", phase_bits=None, precision="double")) as array:
        array.play(clear_any_exposure(focus(), array))
    q = 0.2 * np.exp(1j * focus().phase[0])
    still = cell_weights(skin.model, skin.points, between="waves") @ radiation_pressure(
        transfer_matrix(skin.points, ARRAY) @ q, Medium()
    )
    np.testing.assert_allclose(felt(skin).reshape(-1, 16)[::8], np.tile(still, (20, 1)), rtol=1e-3)
