import numpy as np
import pytest

from midair.evaluate import error_by_energy


def test_faint_frames_are_weighted_by_their_power():
    """Nine frames with 3 % error, and ninety-one of a ten-thousandth of their power with an error of 100."""
    error = np.r_[np.full(9, 0.03), np.full(91, 100.0)]
    power = np.r_[np.full(9, 4.0), np.full(91, 4e-10)]
    found = error_by_energy(error, power)
    assert (found.mean, found.worst, found.faint, found.frames) == (pytest.approx(0.03), 0.03, 91, 100)
    assert found.energy == pytest.approx(np.sqrt((9 * 0.03**2 + 91 * 1e-10 * 1e4) / 9), rel=1e-6)
    assert "91 of 100 frames" in str(found)
    assert "--level auto" in str(found)


def test_by_energy_is_the_norm_of_all_frames_together():
    rng = np.random.default_rng(0)
    asked = rng.random((50, 7)) + 0.2
    came = asked + 0.1 * rng.standard_normal(asked.shape)
    each = np.linalg.norm(came - asked, axis=1) / np.linalg.norm(asked, axis=1)
    found = error_by_energy(each, (asked**2).sum(axis=1))
    assert found.energy == pytest.approx(np.linalg.norm(came - asked) / np.linalg.norm(asked))
    assert found.faint == 0
    assert "frames" not in str(found)


def test_silent_frames_are_left_out_and_silence_has_no_error():
    assert error_by_energy(np.array([0.5, np.nan]), np.array([1.0, 0.0])).mean == 0.5
    assert error_by_energy(np.zeros(3), np.zeros(3)).plain() == {
        "E_energy": 0.0,
        "E_mean": 0.0,
        "E_worst": 0.0,
        "faint_frames": 0,
        "E_faint": 0.0,
    }
