import numpy as np
import pytest

from midair.errors import InputError, NonFiniteError
from midair.recordings import Mending, mend

TIME = np.arange(1500) / 1000
TOUCH = np.sin(2 * np.pi * 83.7 * TIME) + 0.5 * np.sin(2 * np.pi * 212 * TIME)
TOUCH += 0.05 * np.random.default_rng(0).standard_normal(1500)


def holed(frames, *, starts=(300, 700, 1100)):
    samples = np.stack([TOUCH, 3 + TOUCH], axis=1)
    for start in starts:
        samples[start : start + frames, 1] = np.nan
    return samples


@pytest.mark.parametrize("frames", [1, 5, 20])
def test_a_gap_follows_its_neighbourhood_and_the_rest_is_unchanged(frames):
    samples = holed(frames)
    missing = np.isnan(samples)
    filled = mend(samples, 1000, Mending()).samples
    np.testing.assert_array_equal(filled[~missing], samples[~missing])
    error = filled[missing] - (3 + TOUCH)[missing[:, 1]]
    # The noise alone, a twentieth, cannot be known.
    assert np.sqrt((error**2).mean()) < 0.15 * TOUCH.std()


def test_a_line_is_a_line():
    samples = np.array([[0.0], [np.nan], [np.inf], [3.0], [-np.inf], [5.0]])
    filled = mend(samples, 1000, Mending(fill="line")).samples
    np.testing.assert_allclose(filled.ravel(), np.arange(6.0))


def test_ends_hold_the_nearest_number():
    samples = TOUCH[:, None].copy()
    samples[:3] = samples[-2:] = np.nan
    filled = mend(samples, 1000, Mending()).samples.ravel()
    assert (filled[:3] == TOUCH[3]).all()
    assert (filled[-2:] == TOUCH[-3]).all()


def test_the_journal_has_each_gap():
    journal = mend(holed(4, starts=(700, 300)), 1000, Mending()).journal
    assert [(row.kind, row.frame, row.frames, row.channel) for row in journal] == [
        ("mended", 300, 4, 1),
        ("mended", 700, 4, 1),
    ]
    assert mend(TOUCH[:, None], 1000, Mending()).journal == ()


def test_a_longer_gap_is_refused_with_its_place():
    with pytest.raises(NonFiniteError, match=r"20 ms at most, got 21 frames \(21 ms\) from 0\.3 s on in channel 1"):
        mend(holed(21), 1000, Mending())
    assert np.isfinite(mend(holed(21), 1000, Mending(longest=21e-3)).samples).all()
    with pytest.raises(NonFiniteError, match="1500 frames"):
        mend(np.full((1500, 1), np.nan), 1000, Mending())


@pytest.mark.parametrize("wrong", [{"longest": 0}, {"longest": np.nan}, {"fill": "spline"}])
def test_refuses_invalid_settings(wrong):
    with pytest.raises(InputError):
        Mending(**wrong)


def test_silence_and_short_recordings_can_be_filled():
    samples = np.zeros((200, 1))
    samples[100:105] = np.nan
    assert (mend(samples, 1000, Mending()).samples == 0).all()
    short = np.array([[1.0], [np.nan], [3.0]])
    assert mend(short, 1000, Mending()).samples[1, 0] == 2
