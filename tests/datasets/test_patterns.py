import numpy as np
import pytest

from midair.datasets.stimuli import binary_patterns, channel_amplitudes
from midair.errors import InputError


def test_every_pattern_once_and_never_silence():
    assert np.array_equal(np.sort(binary_patterns()), np.arange(1, 65536))


def test_the_first_patterns_do_not_depend_on_the_count():
    assert np.array_equal(binary_patterns(100, seed=5), binary_patterns(seed=5)[:100])
    assert not np.array_equal(binary_patterns(100, seed=5), binary_patterns(100, seed=6))


def test_the_first_few_are_a_fair_sample():
    """Half of the channels are loud, within four standard errors of a binomial distribution."""
    loud = channel_amplitudes(binary_patterns(1024, seed=1)).mean()
    assert abs(loud - 0.5) < 4 * 0.5 / np.sqrt(1024 * 16)


def test_bit_k_is_channel_k():
    amplitude = channel_amplitudes([0x0001, 0x8001, 0x0660])
    assert np.flatnonzero(amplitude[0]).tolist() == [0]
    assert np.flatnonzero(amplitude[1]).tolist() == [0, 15]
    assert np.flatnonzero(amplitude[2]).tolist() == [5, 6, 9, 10]


@pytest.mark.parametrize(("count", "channels"), [(0, 16), (65536, 16), (4, 2), (1, 17)])
def test_too_many_patterns_are_refused(count, channels):
    with pytest.raises(InputError, match="expected 1 to"):
        binary_patterns(count, channels=channels)
