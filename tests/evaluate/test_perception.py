import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import ShapeError
from midair.evaluate.perception import SkinModel, band_levels, blocks, metric_threshold, pacinian_level, similarities


def tone(scale=1.0):
    return scale * np.sin(2 * np.pi * 100 * np.arange(4096) / 8000)


def alike(reference, distorted):
    """ST-SIM and SPQI of one channel."""
    return similarities(reference[:, None], distorted[:, None], compared=np.array([True]))[:, 0]


def cases():
    """vibromaf's own test inputs (tests/metrics/test_stsim.py and test_spqi.py of version 0.0.8), with seeds, and two
    of ours."""
    rng = np.random.default_rng(0)
    level = np.ones(1000) * 1000 + rng.standard_normal(1000)
    ramp = np.linspace(0, 1, 2800)
    return {
        "a level with noise": (level, level + rng.standard_normal(1000)),
        "a ramp, shifted": (ramp, np.append(np.ones(300), ramp)),
        "a tone, rectified": (tone(0.01), np.maximum(tone(0.01), 0)),
        "a faint tone, rectified": (tone(1e-5), np.maximum(tone(1e-5), 0)),
    }


# Results of vibromaf 0.0.8 (PyPI, MIT) on 2026-11-21: ST-SIM, SPQI.
VIBROMAF = {
    "a level with noise": (0.8014194584703337, 0.9070472299473984),
    "a ramp, shifted": (0.7445262743171056, 0.3031451820089071),
    "a tone, rectified": (0.9443350207304178, 0.002937880018632648),
    "a faint tone, rectified": (0.6770018801162178, 0.0029378800186326964),
}


@pytest.mark.parametrize("name", VIBROMAF)
def test_gives_the_numbers_of_vibromaf(name):
    reference, distorted = cases()[name]
    assert alike(reference, distorted) == pytest.approx(VIBROMAF[name], rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_vibromaf_where_it_is_installed(seed):
    metrics = pytest.importorskip("vibromaf.metrics.stsim"), pytest.importorskip("vibromaf.metrics.spqi")
    perception = pytest.importorskip("vibromaf.signal.perception")
    rng = np.random.default_rng(seed)
    reference = rng.standard_normal(3000) * 10.0 ** rng.uniform(-4, 1)
    distorted = reference + rng.standard_normal(3000) * 10.0 ** rng.uniform(-4, 1)
    assert metric_threshold(512) == pytest.approx(perception.PerceptualThreshold(8000).calculate(512), abs=1e-9)
    st_sim, spqi = alike(reference, distorted)
    if metrics[0].STSIM.compute_sim(blocks(reference), blocks(distorted)) > 0:
        assert st_sim == pytest.approx(metrics[0].st_sim(distorted, reference), rel=1e-6)
    assert spqi == pytest.approx(metrics[1].spqi(distorted, reference), rel=1e-9)


def test_equal_signals_and_silent_blocks():
    assert tuple(alike(tone(), tone())) == (1, 1)
    silence = np.zeros(4096)
    assert tuple(alike(silence, tone())) == (0, 0)
    half = np.concatenate([tone(), silence])
    assert alike(half, np.concatenate([tone(0.5), silence]))[0] == pytest.approx(alike(tone(), tone(0.5))[0])


def test_st_sim_exceeds_1_for_a_stronger_signal():
    faint = tone(0.01)
    weak, strong, stronger = (alike(faint, factor * faint)[0] for factor in (0.5, 3, 10))
    assert weak < 1 < strong < stronger


def test_the_other_way_round_is_another_waveform_and_the_same_spectrum():
    assert alike(tone(), -tone()) == pytest.approx((0, 1))


def test_a_difference_as_large_as_the_original():
    assert alike(tone(), np.sqrt(2) * tone())[1] == pytest.approx((1 - np.tanh(2)) / 2, rel=1e-6)
    fifth = 10 ** (-2 / 0.3 / 10)
    assert fifth == pytest.approx(0.2, abs=0.02)
    assert alike(tone(), np.sqrt(1 + fifth) * tone())[1] == pytest.approx(0.5, abs=1e-6)


def test_the_threshold_curve_by_hand():
    curve = metric_threshold(8000, rate=8000.0)
    assert curve[0] == pytest.approx(62 - 77)
    assert curve.min() == pytest.approx(-77, abs=0.01)
    assert np.argmin(curve) / 2 == pytest.approx(250, abs=1)
    assert (np.diff(curve[500:]) >= -1e-9).all()


def test_less_than_a_block_is_refused():
    with pytest.raises(ShapeError, match="512 samples"):
        alike(np.ones(100), np.zeros(100))


def test_skin_by_hand():
    skin = SkinModel()
    assert skin.displacement(np.array(100.0)) == pytest.approx(2 * 0.84 * 100 * 5e-3 / 50e3)  # 16.8 um
    assert skin.threshold(np.array([125.0, 250.0, 500.0])) == pytest.approx(
        0.1e-6 * 10 ** (np.array([12, 0, 9]) / 20), rel=1e-12
    )


@given(st.sampled_from([20.0, 125.0, 250.0, 400.0]), st.floats(0.1, 100))
def test_a_sine_that_is_just_felt_is_at_0_db_and_power_is_power(frequency, factor):
    skin, time = SkinModel(), np.arange(1000) / 1000
    felt = skin.threshold(np.array(frequency)) / skin.displacement(np.array(1.0))
    level = pacinian_level(factor * felt * np.sin(2 * np.pi * frequency * time), 1000.0)
    assert level == pytest.approx(20 * np.log10(factor), abs=1e-9)


def test_a_steady_push_is_not_felt_as_vibration():
    assert pacinian_level(np.full((200, 2), 7.0), 1000.0).max() < -200


def test_the_detection_threshold_by_frequency_and_area():
    """Verrillo (1963): flat to 40 Hz, then 12 dB an octave to 250 Hz; 3 dB a doubled area from .02 to 2.9 cm2."""
    skin = SkinModel()
    large, half, small = (skin.detection_threshold(np.array([20.0, 40.0, 125.0, 250.0]), each) for each in AREAS)
    assert 20 * np.log10(large / 0.1e-6) == pytest.approx([31.7, 31.7, 12, 0], abs=0.05)
    assert 20 * np.log10(half / large) == pytest.approx([0, 0, 3.01, 3.01], abs=0.01)
    assert 20 * np.log10(small / large) == pytest.approx([0, 0, 31.7 - 12, 21.6], abs=0.05)


AREAS = (2.9e-4, 1.45e-4, 1e-9)


def test_the_threshold_agrees_with_that_of_radiation_force():
    """Dalecki et al. (1995, doi 10.1121/1.411877): .4 mN on 1.8 cm2 of a finger, a square wave at 200 Hz."""
    skin, area = SkinModel(), 1.8e-4
    fundamental = 2 / np.pi * 0.4e-3 / area
    told = skin.displacement(np.array(fundamental)) / skin.detection_threshold(np.array([200.0]), area)
    assert abs(20 * np.log10(told[0])) < 6


@pytest.mark.parametrize(("frequency", "band"), [(25.0, 0), (80.0, 1), (250.0, 2)])
def test_a_sine_at_its_threshold_has_0_db_in_its_band_alone(frequency, band):
    skin, area = SkinModel(), 1.21e-4
    peak = skin.detection_threshold(np.array([frequency]), area)[0] / skin.displacement(np.array(1.0))
    sine = peak * np.sin(2 * np.pi * frequency * np.arange(1000) / 1000)
    levels = band_levels(sine[:, None], 1000.0, area=area)[:, 0]
    assert levels[band] == pytest.approx(0, abs=1e-6)
    assert (np.delete(levels, band) < -100).all()
