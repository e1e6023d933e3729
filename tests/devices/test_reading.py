import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.devices import FrameBlock
from midair.devices.reading import GapFiller
from midair.errors import DeviceError


def block(first, count):
    samples = np.arange(first, first + count, dtype=float).reshape(-1, 1, 1)
    return FrameBlock(samples=samples, first=first, device_time=0, host_time=0)


def test_a_gap_is_held_at_the_last_frame():
    seam = GapFiller("bench", 1000)
    assert seam.add(block(0, 3)).lost == 0
    part = seam.add(block(5, 2))
    assert (part.first, part.lost) == (3, 2)
    np.testing.assert_array_equal(part.samples.ravel(), [2, 2, 5, 6])
    assert seam.frames == 7
    assert [seam.add(block(7, count)).lost for count in (0, 1)] == [0, 0]


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(1, 40)), min_size=1, max_size=20))
def test_frame_i_stays_frame_i(pieces):
    """Each block: a number of lost frames, then a number of received ones."""
    seam, parts, lost, at = GapFiller("bench", 1000), [], 0, 0
    for gap, count in pieces:
        at += gap
        part = seam.add(block(at, count))
        at += count
        parts.append(part.samples.ravel())
        lost += part.lost
    together = np.concatenate(parts)
    assert len(together) == at == seam.frames
    assert lost == sum(gap for gap, _ in pieces)
    assert (together == np.arange(at)).sum() == at - lost


def test_a_sensor_that_began_anew_is_refused():
    for first in (0, 9, 60_011):
        seam = GapFiller("bench", 1000)
        seam.add(block(0, 10))
        with pytest.raises(DeviceError, match="expected frame 10 or one soon after"):
            seam.add(block(first, 1))
