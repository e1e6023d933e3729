"""A source behind a filter: indices, times and gaps of its frames, compared with the filter alone."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.devices.sensors.test_streamed_sensor import Script

from midair.devices.sensors.decimated import CENTRE, Decimated, Decimator
from midair.devices.sensors.sources import Chunk
from midair.errors import DeviceStateError

RATE = 3000.0


def array_source(samples, *, lost=range(0)):
    """Returns the rows of an array in blocks of 100; frames in `lost` are missing."""
    chunks = [
        Chunk(samples=samples[at : at + 100], first=at, device_time=10 + at / RATE, host_time=50 + at / RATE)
        for at in range(0, len(samples), 100)
        if at not in lost
    ]
    return Script(chunks, channels=samples.shape[1], rate=RATE, unit="V", full_scale=5.0)


def samples(frames=3000, channels=2):
    return np.random.default_rng(0).normal(size=(frames, channels))


def everything(source, rate=1000.0):
    decimated = Decimated(source, rate)
    decimated.open()
    decimated.start()
    chunks = []
    while (chunk := decimated.pull(0.0)) is not None or source.left:
        if chunk is not None:
            chunks.append(chunk)
    return chunks


def test_it_is_the_filter_at_the_lower_rate_with_the_times_of_its_middle():
    source = array_source(samples())
    decimated = Decimated(source, 1000.0)
    assert decimated.open() == replace(source.stream, rate=1000.0)
    assert decimated.describe() == {"native rate": "3000 Hz", "filter delay": "64 ms"}
    chunks = everything(source)
    alone = Decimator(RATE, 1000.0).push(samples())
    np.testing.assert_allclose(np.concatenate([chunk.samples for chunk in chunks]), alone, atol=1e-12)
    assert chunks[0].first == 0
    assert all(one.first + len(one) == after.first for one, after in pairwise(chunks))
    for chunk in chunks:
        happened = (chunk.first + CENTRE) / 1000.0
        assert (chunk.device_time, chunk.host_time) == (pytest.approx(10 + happened), pytest.approx(50 + happened))


@pytest.mark.parametrize("gap", [range(1000, 1100), range(1000, 1300)])
def test_no_frame_is_made_across_a_gap(gap):
    data = samples()
    chunks = everything(array_source(data, lost=gap))
    late = [chunk for chunk in chunks if chunk.device_time - 10 > gap.start / RATE]
    # The filter is empty after the gap: the next frame is the one whose filter lies wholly behind it.
    run = -(-gap.stop // 3)
    assert late[0].first == run
    alone = Decimator(RATE, 1000.0).push(data[3 * run :])
    np.testing.assert_allclose(np.concatenate([chunk.samples for chunk in late]), alone, atol=1e-12)
    assert late[0].device_time == pytest.approx(10 + (run + CENTRE) / 1000)


def test_a_source_of_that_rate_is_passed_on():
    source = array_source(samples(frames=300))
    chunks = everything(source, rate=RATE)
    assert [chunk.first for chunk in chunks] == [0, 100, 200]
    np.testing.assert_array_equal(np.concatenate([chunk.samples for chunk in chunks]), samples(frames=300))


def test_starting_again_begins_with_an_empty_filter():
    source = array_source(samples())
    decimated = Decimated(source, 1000.0)
    decimated.open()
    first = []
    for _ in range(2):
        decimated.start()
        first.append(next(chunk for chunk in iter(lambda: decimated.pull(0.0), 0) if chunk is not None))
        decimated.stop()
        assert source.calls[-1] == "stop"
    np.testing.assert_array_equal(first[0].samples, first[1].samples)
    assert first[0].first == first[1].first == 0
    decimated.close()
    assert source.calls[-1] == "close"


def test_it_must_be_open():
    source = array_source(samples())
    decimated = Decimated(source, 1000.0)
    decimated.start()
    with pytest.raises(DeviceStateError, match="open first"):
        decimated.pull(0.0)
