import numpy as np
import pytest

from midair.devices.sensors.sources import Chunk


def chunk(samples, first=100):
    return Chunk(samples=np.asarray(samples, float), first=first, device_time=2.0, host_time=5.0)


def test_a_part_keeps_its_number_and_its_times():
    part = chunk(np.arange(12).reshape(6, 2)).part(2, 5, 1000.0)
    assert part.samples.tolist() == [[4, 5], [6, 7], [8, 9]]
    assert (len(part), part.first) == (3, 102)
    assert (part.device_time, part.host_time) == (pytest.approx(2.002), pytest.approx(5.002))


def test_a_whole_chunk_is_given_as_it_is():
    whole = chunk(np.ones((3, 2)))
    assert list(whole.finite_parts(1000.0)) == [whole]


@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
def test_frames_that_are_missing_cut_a_chunk(missing):
    samples = np.arange(14.0).reshape(7, 2)
    samples[[0, 3, 4, 6], [0, 1, 0, 1]] = missing
    parts = list(chunk(samples).finite_parts(1000.0))
    assert [(part.first, len(part)) for part in parts] == [(101, 2), (105, 1)]
    assert parts[1].samples.tolist() == [[10, 11]]
    assert parts[1].device_time == pytest.approx(2.005)


def test_nothing_whole_gives_nothing():
    assert list(chunk(np.full((4, 2), np.nan)).finite_parts(1000.0)) == []
