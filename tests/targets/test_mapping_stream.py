import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.errors import DeviceStateError, InputError, ShapeError
from midair.targets import MAPPINGS, MappingStream, constant_offset, mapping_of

OFFSET = {"constant-offset": {"offset": 2.5}}
BLOCKS = st.lists(st.integers(1, 200), min_size=1, max_size=6)


def stream(name, rate=1000.0):
    return MappingStream(name, rate, **OFFSET.get(name, {}))


def offline(name, pressure, rate=1000.0):
    return constant_offset(pressure, **OFFSET[name]) if name in OFFSET else MAPPINGS[name](pressure, rate)


@pytest.mark.parametrize("name", MAPPINGS)
@settings(max_examples=25, deadline=None)
@given(blocks=BLOCKS, seed=st.integers(0, 2**32 - 1))
def test_all_blocks_together_equal_the_whole(name, blocks, seed):
    pressure = np.random.default_rng(seed).normal(size=(sum(blocks), 2, 2))
    one = stream(name)
    ends = np.cumsum(blocks)
    out = [one.push(pressure[end - size : end]) for end, size in zip(ends, blocks, strict=True)]
    np.testing.assert_array_equal(np.concatenate([*out, one.finish()]), offline(name, pressure))


@pytest.mark.parametrize(("name", "delay"), [("half-wave", 0), ("constant-offset", 0), ("slow-bias", 90)])
def test_frames_go_out_exactly_the_stated_delay_later(name, delay):
    pressure = np.random.default_rng(1).normal(size=(300, 1, 1))
    one = stream(name)
    assert one.delay == delay
    out = np.concatenate([one.push(frame[None]) for frame in pressure])
    np.testing.assert_array_equal(out, offline(name, pressure)[: 300 - delay])


def test_the_delay_in_seconds_does_not_depend_on_the_rate():
    assert stream("slow-bias", 4000.0).delay == pytest.approx(0.09 * 4000, abs=2)


def test_in_a_lower_band_it_is_as_much_later_and_the_same():
    band, pressure = (5.0, 100.0), np.random.default_rng(4).normal(size=(900, 1, 1))
    one = MappingStream("slow-bias", 500.0, band=band)
    assert one.delay == 180
    out = np.concatenate([one.push(pressure[:500]), one.push(pressure[500:]), one.finish()])
    np.testing.assert_array_equal(out, mapping_of("slow-bias", band)(pressure, 500.0))


def test_the_offset_of_the_whole_recording_streams_to_the_same():
    pressure = np.random.default_rng(2).normal(size=(100, 2, 2))
    offset = np.maximum(-pressure.min(axis=0), 0)
    one = MappingStream("constant-offset", 1000.0, offset=offset)
    out = np.concatenate([one.push(pressure[:40]), one.push(pressure[40:]), one.finish()])
    np.testing.assert_allclose(out, constant_offset(pressure), atol=1e-12)


def test_after_finish_it_begins_again():
    pressure = np.random.default_rng(3).normal(size=(200, 1, 1))
    one = stream("slow-bias")
    first = np.concatenate([one.push(pressure), one.finish()])
    again = np.concatenate([one.push(pressure), one.finish()])
    np.testing.assert_array_equal(first, again)


def test_mappings_that_cannot_be_streamed_are_refused():
    with pytest.raises(InputError, match="got none for constant-offset; measure it"):
        MappingStream("constant-offset", 1000.0)
    with pytest.raises(InputError, match="got one for half-wave"):
        MappingStream("half-wave", 1000.0, offset=1.0)
    with pytest.raises(InputError, match="mapping: expected one of half-wave"):
        MappingStream("full-wave", 1000.0)
    with pytest.raises(ShapeError, match="at least one frame"):
        stream("half-wave").push(np.zeros((0, 4, 4)))
    with pytest.raises(DeviceStateError, match="push before finish"):
        stream("slow-bias").finish()
