"""The serial protocol byte by byte, and its decoder with noise, incomplete frames and gaps."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.devices.sensors.serial_frames import WRAP, Decoder, Layout, encode
from midair.errors import DeviceError, InputError


def frame(number, width=2, channels=3, **settings):
    ramp = 100 * number + np.arange(channels)
    return encode(ramp, counter=number, time_us=1000 * number, width=width, **settings)


def decoded(data, decoder=None):
    """[(counter, first channel)] of all frames found."""
    decoder = decoder or Decoder()
    runs = decoder.push(data)
    return [(run.counter + i, int(row[0])) for run in runs for i, row in enumerate(run.samples)]


def test_a_frame_written_by_hand():
    body = bytes.fromhex(
        "01 02 02 00"  # version, bytes of a sample, channels, flags
        "40 42 0f 00"  # 1 000 000 ns
        "07 00 00 00"  # frame 7
        "70 17 00 00"  # 6000 µs
        "01 00 fe ff"  # 1, -2
    )
    data = b"\xa5\x5a" + body + zlib.crc32(body).to_bytes(4, "little")
    assert encode([1, -2], counter=7, time_us=6000) == data
    # The line in docs/build-a-sensor.md.
    assert data.hex(" ").endswith("01 00 fe ff dd db 75 64")
    decoder = Decoder()
    (run,) = decoder.push(data)
    np.testing.assert_array_equal(run.samples, [[1, -2]])
    assert (run.counter, run.time_us) == (7, 6000)
    assert decoder.layout == Layout(channels=2, width=2, period=1_000_000)


def test_extremes_come_back(subtests):
    for width, extremes in [(2, [-32768, 32767]), (3, [-8388608, 8388607])]:
        with subtests.test(width=width):
            (run,) = Decoder().push(encode(extremes, counter=0, time_us=0, width=width))
            np.testing.assert_array_equal(run.samples, [extremes])
            too_much = [extremes[0] - 1, 0]
            with pytest.raises(InputError, match=f"samples of {width} bytes"):
                encode(too_much, counter=0, time_us=0, width=width)


@given(st.lists(st.tuples(st.binary(max_size=60), st.booleans()), min_size=1, max_size=12), st.integers(1, 50))
def test_every_sent_frame_is_found_once_among_noise_however_it_is_cut(parts, size):
    # Noise after which a frame follows may only hide that frame if it looks like its beginning: no sync word in it.
    stream, sent = frame(0), [(0, 0)]
    for number, (noise, lost) in enumerate(parts, start=1):
        stream += noise.replace(b"\xa5", b"\x00")
        if not lost:
            stream += frame(number)
            sent.append((number, 100 * number))
    decoder, got = Decoder(), []
    for at in range(0, len(stream), size):
        got += decoded(stream[at : at + size], decoder)
    assert got == sent
    assert decoder.broken == 0


@given(st.binary(max_size=300), st.integers(0, 2**32 - 1))
def test_any_noise_before_frames_costs_at_most_what_it_can_pass_off_as_one(noise, seed):
    # A false sync word can hold the decoder up for as long as the longest frame, 787 bytes: then it finds all.
    stream = noise + b"".join(frame(number) for number in range(60))
    got = decoded(stream)
    assert got == [(number, 100 * number) for number in range(got[0][0], 60)]
    assert got[0][0] == 0 or got[0][0] * 28 <= 787


@given(st.integers(0, 27), st.integers(1, 255))
def test_a_damaged_byte_costs_its_frame_only(at, change):
    damaged = bytearray(frame(1))
    damaged[at] ^= change
    got = decoded(frame(0) + bytes(damaged) + frame(2) + frame(3))
    assert got == [(0, 0), (2, 200), (3, 300)]


def test_a_cut_frame_and_holes_show_in_the_counter():
    decoder = Decoder()
    runs = decoder.push(frame(0) + frame(1)[:11] + frame(2) + frame(3) + frame(9))
    assert [(run.counter, len(run.samples)) for run in runs] == [(0, 1), (2, 2), (9, 1)]
    assert decoder.skipped == 11
    decoder = Decoder()
    decoder.push(frame(0))
    assert decoder.push(frame(1, channels=4)) == []
    assert decoder.skipped == len(frame(1, channels=4))


def test_counter_and_time_go_on_over_their_wraps():
    decoder = Decoder()
    last = encode([1], counter=WRAP - 1, time_us=WRAP - 500)
    first = encode([2], counter=WRAP, time_us=WRAP + 500)
    (run,) = decoder.push(last + first)
    assert run.counter == WRAP - 1
    (run,) = decoder.push(encode([3], counter=WRAP + 1, time_us=WRAP + 1500))
    assert (run.counter, run.time_us) == (WRAP + 1, WRAP + 1500)
    decoder = Decoder()
    decoder.push(frame(300))
    with pytest.raises(DeviceError, match=r"after number 300, got 0; the sensor restarted"):
        decoder.push(frame(0))
