import numpy as np
import pytest

from midair.calibration import calibrate
from midair.datasets import Motion, stroke
from midair.dsp import band_energy, resample, welch
from midair.model import Recording, SensorGrid
from midair.physics import SensorModel, calibration_of, sense

OBJECTS = ("brush", "sponge", "towel")
PASSED = [2, 6, 10, 14]


@pytest.fixture(scope="module")
def heard():
    """As in the paper's Fig. 9: recorded, calibrated, half-wave rectified; channels 2, 6, 10, 14 of several strokes."""
    model = SensorModel().with_spread(seed=1)
    calibration = calibration_of(model)

    def once(name, groove, seed):
        true = stroke(name, groove=groove, seed=seed, rate=8000.0)
        volts = sense(model, true.pressure, 1000.0, rng=np.random.default_rng(seed), oversample=8)
        pressure = calibrate(Recording(samples=volts, rate=1000.0, sensor=true.sensor), calibration).pressure
        return np.maximum(pressure, 0).reshape(-1, 16)[:, PASSED]

    return {
        (name, groove): [once(name, groove, seed) for seed in range(2)] for name in OBJECTS for groove in (False, True)
    }


def energies(waves, band):
    return np.array([band_energy(wave, 1000.0, band).mean() for wave in waves])


@pytest.mark.long
def test_strokes_sound_as_the_objects_and_surfaces_of_the_paper(heard, subtests):
    for groove in (False, True):
        with subtests.test(groove=groove):
            brush, sponge, towel = (energies(heard[name, groove], (300.0, 470.0)) for name in OBJECTS)
            # every seed of one object over every seed of the next, by 2 dB and more
            assert towel.min() > 10**0.2 * sponge.max()
            assert sponge.min() > 10**0.2 * brush.max()
    for name in OBJECTS:
        with subtests.test(name=name):
            low, high = (
                10 * np.log10(energies(heard[name, True], band) / energies(heard[name, False], band))
                for band in ((20.0, 300.0), (300.0, 470.0))
            )
            # grooves raise the intensity most below 300 Hz, in dB
            assert low.min() > 4
            assert high.min() > 0
            assert (low > high).all()
            # of the strokes' 33 to 65 Pa, 10 Pa and more are left as peaks above 0
            assert all(wave.max() > 8 for groove in (False, True) for wave in heard[name, groove])
            true = stroke(name).pressure.reshape(-1, 16)[:, 6]
            assert 0.001 < band_energy(true, 1000.0, (20, 470)) / true.var() < 0.5


def test_each_cell_is_passed_when_the_contact_is_over_it():
    for speed in (0.05, 0.1):
        frames = stroke("sponge", speed=speed)
        smooth = lambda x: np.convolve(x, np.hanning(101), "same")  # noqa: E731
        weight = np.apply_along_axis(smooth, 0, frames.pressure.reshape(-1, 16)[:, PASSED]) ** 2
        centre = (frames.time[:, None] * weight).sum(axis=0) / weight.sum(axis=0)
        # the edge of a contact of 20 mm, felt over 8 mm, starts 1 mm from the first cell; cells are 11 mm apart
        assert centre == pytest.approx((0.015 + 0.011 * np.arange(4)) / speed, abs=0.002 / speed), speed
        assert Motion(speed=speed).passage(SensorGrid()) == pytest.approx((0.015 + 0.011 * np.arange(4)) / speed)


def test_a_contact_of_two_centimetres_touches_its_column_for_two_centimetres():
    frames = stroke("towel")
    for row in range(4):
        on = np.flatnonzero(frames.pressure[:, row, 2] > 0.02)
        assert (on[-1] - on[0]) / 1000 * 0.05 == pytest.approx(0.028, abs=0.002)  # with its soft edge
        full = np.flatnonzero(Motion().cover(SensorGrid(), frames.time)[:, row, 2] > 0.5)
        assert len(full) / 1000 * 0.05 == pytest.approx(0.020, abs=1e-4)
    frames = stroke("towel", groove=True)
    assert np.abs(frames.pressure[:15]).max() < 0.01
    assert np.abs(frames.pressure[-15:]).max() < 0.01
    rms = np.sqrt((frames.pressure**2).mean(axis=(0, 1)))
    assert rms[0] == 0  # 22 mm away
    assert rms[1] < 0.5 * rms[2]
    assert rms[3] < 0.5 * rms[2]
    other = stroke("towel", groove=True, column=0)
    assert (other.pressure[:, :, 2:] == 0).all()


def test_cells_of_a_column_measure_the_same_profile_in_turn():
    # towel without slips: the profile is fixed to the object
    motion, sensor = Motion(), SensorGrid()
    frames = stroke("towel", rate=8000.0)
    rough = frames.pressure - 30.0 * motion.cover(sensor, frames.time)
    late = round(11e-3 / 0.05 * 8000)
    upper, lower = rough[:-late, 0, 2], rough[late:, 1, 2]
    assert np.corrcoef(upper, lower)[0, 1] > 0.6
    assert abs(np.corrcoef(rough[:-late, 0, 2], rough[:-late, 1, 2])[0, 1]) < 0.3


def test_twice_the_speed_puts_the_texture_at_twice_the_frequency():
    def centroid(speed):
        density = 0
        for seed in range(4):
            x = stroke("towel", seed=seed, speed=speed, rate=8000.0).pressure[:, 1, 2]
            f, one = welch(x, 8000.0, resolution=16.0)
            density = density + one
        inside = (f > 30) & (f < 2000)
        return (f * density)[inside].sum() / density[inside].sum()

    assert centroid(0.1) / centroid(0.05) == pytest.approx(2, rel=0.25)


@pytest.mark.parametrize("name", ["brush", *(pytest.param(name, marks=pytest.mark.long) for name in OBJECTS[1:])])
def test_the_peak_is_in_the_documented_range(name):
    for groove, low, high in ((True, 41, 71), (False, 32.5, 50.5)):
        peaks = [stroke(name, groove=groove, seed=seed).pressure.max() for seed in range(10)]
        assert low < min(peaks) < max(peaks) < high, groove
        assert stroke(name, groove=groove, peak=60.0).pressure.max() == pytest.approx(60), groove


@pytest.mark.long
def test_one_seed_makes_one_stroke_at_every_rate():
    one, same, other = (stroke("brush", seed=seed) for seed in (3, 3, 4))
    assert (one.pressure == same.pressure).all()
    assert not (one.pressure == other.pressure).all()
    fine = stroke("brush", seed=3, rate=8000.0)
    assert resample(fine.pressure, 8000.0, 1000.0) == pytest.approx(one.pressure, abs=1e-12)
    assert stroke("brush", seed=3, rate=35.6).rate == 35.6


def test_a_duration_cuts_or_adds_silence_and_the_provenance_names_the_object():
    whole = stroke("towel", seed=1)
    assert whole.frames == pytest.approx(1000 * Motion().duration(SensorGrid()), abs=1.5)
    assert (stroke("towel", seed=1, duration=0.4).pressure == whole.pressure[:400]).all()
    longer = stroke("towel", seed=1, duration=2.0)
    assert longer.frames == 2000
    assert (longer.pressure[: whole.frames] == whole.pressure).all()
    assert not longer.pressure[whole.frames :].any()
    frames = stroke("brush", groove=True, seed=9)
    assert frames.provenance.simulated
    assert frames.provenance.source == "virtual:brush"
    assert frames.provenance.notes == {"object": "brush", "surface": "groove"}
    step = frames.provenance.steps[-1]
    assert (step.stage, step.settings["seed"], step.settings["groove"]) == ("stroke", 9, True)
    assert step.settings["peak_pa"] == frames.pressure.max()
    assert frames.band is None


@pytest.mark.long
def test_pressure_is_positive_except_for_ringing():
    assert min(stroke(name, groove=True, seed=seed).pressure.min() for name in OBJECTS for seed in range(4)) > -3
    assert stroke("towel", groove=True, rate=8000.0).pressure.min() == 0
