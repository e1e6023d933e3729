import json

import numpy as np
import pytest

from midair.evaluate import PalmPressure
from midair.model import Palm
from midair.physics import SKINS, SkinMotion, Tissue

PALM, RATE, SQUARE = Palm.disc(60e-3, pitch=5e-3), 2000.0, (15e-3, 15e-3)
BEYOND = PALM.beyond(*SQUARE)[PALM.inside]
TWO_SKINS = {"soft": Tissue(), "layer": Tissue(depth=5e-3)}


def waves(frames, points, seed):
    """Sines in the band with changing amplitudes, different at each point."""
    rng = np.random.default_rng(seed)
    turns = np.arange(frames)[:, None, None] / RATE * np.arange(40, 400, 40)[:, None]
    fade = np.hanning(frames)[:, None]
    return fade * (
        np.sin(2 * np.pi * turns + rng.uniform(0, 7, (1, 9, points))) * rng.standard_normal((9, points))
    ).sum(1)


@pytest.fixture(scope="module")
def wanted():
    return np.where(BEYOND, 0.0, waves(600, BEYOND.size, 0))


def pressed(wanted, delivered):
    return PalmPressure(wanted=wanted, delivered=delivered, rates=(RATE, RATE), palm=PALM, square=SQUARE)


def judged(wanted, delivered, **more):
    return pressed(wanted, delivered).fidelity(skins=TWO_SKINS, **more)


@pytest.mark.long
def test_the_same_but_later_and_louder_is_whole(wanted):
    late = np.concatenate([np.zeros((7, wanted.shape[1])), 3.0 * wanted[:-7]])
    found = judged(wanted, late, judged=(0.1, 0.1))
    assert found.outside == 0.0
    assert min(found.pressure, found.square, *found.displacement.values()) > 40


@pytest.mark.long
def test_only_a_varying_leak_counts(wanted):
    steady = judged(wanted, wanted + 100.0 * BEYOND, judged=(0.1, 0.1))
    assert steady.outside < 1e-3
    leak = np.where(BEYOND, waves(600, BEYOND.size, 1), 0.0)
    leak *= np.sqrt((wanted[200:400] ** 2).sum() / (leak[200:400] ** 2).sum()) / 2
    found = judged(wanted, wanted + leak, judged=(0.1, 0.1))
    # A quarter of the power is added outside: a fifth of the total, and 6 dB.
    assert found.outside == pytest.approx(0.2, abs=2e-3)
    assert found.pressure == pytest.approx(6.02, abs=0.1)
    assert found.square > 40
    assert all(ratio < 20 for ratio in found.displacement.values())


def test_skin_moves_beside_the_pressure(wanted):
    # Noise only in the outermost ring of the palm.
    x, y = np.meshgrid(PALM.grid(1.0).x, PALM.grid(1.0).y)
    ring = (np.hypot(x, y) > 25e-3)[PALM.inside]
    found = judged(wanted, wanted + ring * waves(600, BEYOND.size, 2), judged=(0.1, 0.1))
    assert found.range == (min(found.displacement.values()), max(found.displacement.values()))
    assert found.range[0] < found.range[1]


def test_silence_gives_no_number_and_no_error(wanted):
    found = judged(wanted, np.zeros_like(wanted))
    assert found.outside == 0.0
    assert found.pressure == -np.inf
    plain = json.loads(json.dumps(found.plain(), allow_nan=False))
    assert plain["sdr_pressure_db"] is None
    assert plain["palm"] == "disc of 60 mm"
    assert "SIMULATED" in repr(found)


def test_frames_are_the_compared_quantities(wanted):
    late = np.concatenate([np.zeros((8, wanted.shape[1])), 3.0 * wanted[:-8]])
    found = pressed(wanted, late).frames(judged=(0.1, 0.1), band=(20.0, 450.0), skin="stiff, deep")
    assert found.rate == 1000.0
    assert found.wanted.shape == found.motion.shape == (100, *PALM.inside.shape)
    assert np.isnan(found.delivered[:, ~PALM.inside]).all()
    # The target has the level and the delay of the delivered pressure.
    inside = (slice(None), PALM.inside)
    np.testing.assert_allclose(found.wanted[inside], found.delivered[inside], atol=0.02 * np.nanmax(found.wanted))
    np.testing.assert_allclose(found.wanted[inside], 3 * wanted[200:400:2], atol=0.1 * np.nanmax(found.wanted))
    load = np.zeros((len(wanted), *PALM.inside.shape))
    load[inside] = 3 * wanted
    skin = SkinMotion.of(SKINS["stiff, deep"], PALM.inside.shape, pitch=PALM.pitch, rate=RATE, band=(20.0, 450.0))
    moved = skin.displacement(load)[200:400:2]
    np.testing.assert_allclose(found.motion[inside], moved[inside], atol=0.1 * np.abs(moved).max())
