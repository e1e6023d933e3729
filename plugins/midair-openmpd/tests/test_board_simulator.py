"""The stand-in against bytes made by hand from the firmware's sources."""

import os

import numpy as np
import pytest
from board_simulator import CommandReader, OpenMpdSimulator, PinFrame


def frame(first=0, length=0):
    return bytes([0x80 | first] + [first] * 255 + [length] * 256)


def read(*texts):
    seen = []
    reader = CommandReader(seen.append)
    for text in texts:
        reader.read(text)
    return seen, reader


def test_a_frame_begins_at_the_eighth_bit_and_has_512_bytes():
    seen, _ = read(bytes([1, 2, 3]), frame(5, 64), bytes([7]), frame(6, 0)[:300], frame(6, 0)[300:])
    assert [one.start.tolist() for one in seen] == [[5] * 256, [6] * 256]
    assert [one.sounds for one in seen] == [True, False]


def test_a_divider_is_sent_lowest_bit_first_and_applied_on_request():
    text = bytearray(frame())
    text[27] = text[29] = text[33] = 0x80
    seen, reader = read(bytes(text))
    assert reader.divider == 4
    text[34] = 0x80
    seen, reader = read(bytes(text))
    assert (reader.divider, seen[0].divider) == (0b10001010, 0b10001010)
    assert not seen[0].sounds


@pytest.mark.parametrize(("start", "length"), [(0, 64), (32, 64), (100, 64), (0, 20), (120, 21), (127, 1)])
def test_the_first_harmonic_of_a_pulse(start, length):
    """sin(pi A / 128) at the middle of the pulse: Fourier's series of a rectangle."""
    one = PinFrame(start=np.full(256, start, np.uint8), length=np.full(256, length, np.uint8), divider=4)
    # A pulse on steps begins and ends half a step before where its samples are.
    middle = (start + length / 2 - 32) * 2 * np.pi / 128
    wanted = np.sin(np.pi * length / 128) * np.exp(1j * middle)
    assert one.sound()[0] == pytest.approx(wanted, abs=1e-12)


def test_a_frame_is_held_until_the_next_one():
    board = OpenMpdSimulator()
    try:
        assert not board.sounds
        line = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
        os.write(line, frame(9, 64))
        os.close(line)
        board.settle()
        assert board.sounds
        assert board.held.start[77] == 9
        line = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
        os.write(line, frame())
        board.settle()
        assert not board.sounds
        assert len(board.heard) == 1
        os.close(line)
    finally:
        board.close()
