import numpy as np
import pytest

from midair.evaluate.perception import blocks, metric_threshold, similarities


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


def test_gives_the_numbers_of_vibromaf():
    found = {name: alike(*pair) for name, pair in cases().items()}
    assert found == {name: pytest.approx(known, rel=1e-9) for name, known in VIBROMAF.items()}


def test_agrees_with_vibromaf_where_it_is_installed():
    metrics = pytest.importorskip("vibromaf.metrics.stsim"), pytest.importorskip("vibromaf.metrics.spqi")
    perception = pytest.importorskip("vibromaf.signal.perception")
    assert metric_threshold(512) == pytest.approx(perception.PerceptualThreshold(8000).calculate(512), abs=1e-9)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        reference = rng.standard_normal(3000) * 10.0 ** rng.uniform(-4, 1)
        distorted = reference + rng.standard_normal(3000) * 10.0 ** rng.uniform(-4, 1)
        st_sim, spqi = alike(reference, distorted)
        if metrics[0].STSIM.compute_sim(blocks(reference), blocks(distorted)) > 0:
            assert st_sim == pytest.approx(metrics[0].st_sim(distorted, reference), rel=1e-6), seed
        assert spqi == pytest.approx(metrics[1].spqi(distorted, reference), rel=1e-9), seed


def test_equal_signals_and_silent_blocks():
    assert tuple(alike(tone(), tone())) == (1, 1)
    silence = np.zeros(4096)
    assert tuple(alike(silence, tone())) == (0, 0)
    half = np.concatenate([tone(), silence])
    assert alike(half, np.concatenate([tone(0.5), silence]))[0] == pytest.approx(alike(tone(), tone(0.5))[0])
    # A filter leaves a little of a signal that has ended.
    ended = [np.concatenate([tone(), left * np.random.default_rng(0).normal(size=4096)]) for left in (1e-8, 1e-5)]
    assert alike(*ended) == pytest.approx((1, 1))
    # The other way round it is another waveform and the same spectrum.
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
