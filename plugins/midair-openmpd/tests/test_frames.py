"""Bytes of a frame, compared with the stand-in's parser and the resulting pulses."""

import numpy as np
import pytest
from board_simulator import CommandReader, measured_board

from midair.errors import RateError
from midair.model import Drive
from midair.streaming import LazyFrames
from midair_openmpd import Board, array_of_boards
from midair_openmpd.driver import (
    AHEAD,
    FramesAhead,
    drive_frames,
    off_frame,
    off_frames,
    pulse_lengths,
    rate_divider,
)


def some_drive(boards, level=1.0, frames=6, seed=1):
    array, rng = array_of_boards(*boards), np.random.default_rng(seed)
    phase = rng.uniform(-10, 10, (frames, array.count))
    return Drive(phase=phase, level=np.broadcast_to(level, (frames,)), rate=1000.0, array=array)


def put_out(text, board):
    """Pulses of each transducer for the bytes, frame by frame, delayed by its own offset."""
    seen = []
    CommandReader(seen.append).read(text)
    return np.array([one.sound()[board.pin] for one in seen]) * np.exp(1j * board.offset)


@pytest.mark.parametrize("boards", [[measured_board(0)], [measured_board(1), measured_board(2)]], ids=["one", "twin"])
def test_every_transducer_sounds_as_the_drive_says(boards):
    drive = some_drive(boards)
    texts = drive_frames(drive, 0, 6, boards)
    heard = np.concatenate([put_out(text, board) for text, board in zip(texts, boards, strict=True)], axis=1)
    assert heard.shape == drive.phase.shape
    turned = np.angle(heard * np.exp(-1j * drive.phase))
    # Half of a step of 128, and the offsets' own rounding in none of them.
    assert np.abs(turned).max() <= np.pi / 128 + 1e-9
    np.testing.assert_allclose(np.abs(heard), 1, atol=1e-12)


@pytest.mark.parametrize("level", [0.9, 0.5, 0.1, 0.025])
def test_the_middle_of_a_pulse_stays_where_it_is_whatever_its_length(level):
    board = measured_board(3)
    drive = some_drive([board], level)
    heard = put_out(drive_frames(drive, 0, 6, [board])[0], board)
    on = np.abs(heard) > 0
    assert on.any()
    turned = np.angle(heard * np.exp(-1j * drive.phase))[on]
    assert np.abs(turned).max() <= np.pi / 128 + 1e-9


def test_frames_begin_again_after_the_last():
    board = measured_board()
    drive = some_drive([board], frames=3)
    once, (twice,) = drive_frames(drive, 0, 3, [board])[0], drive_frames(drive, 2, 5, [board])
    assert twice == once[1024:] + once + once[:512]


def test_every_pulse_length_of_the_firmware_is_reproduced_exactly():
    lengths = np.repeat(np.arange(65)[:, None], 256, axis=1)
    np.testing.assert_array_equal(pulse_lengths(np.sin(np.pi * lengths / 128)), lengths)


def test_a_level_between_two_lengths_takes_the_quieter_and_all_transducers_take_the_same():
    levels = np.linspace(0, 1, 500)
    lengths = pulse_lengths(np.repeat(levels[:, None], 256, axis=1))
    played = np.sin(np.pi * lengths / 128)
    assert (played <= levels[:, None] + 0.00025).all()
    assert np.abs(played - levels[:, None]).max() < 0.0246
    assert np.ptp(lengths, axis=1).max() == 0


def test_a_strength_weakens_a_transducer():
    plain = Board.nominal()
    strength = np.linspace(0, 1, 256)
    board = Board(position=plain.position, pin=plain.pin, offset=plain.offset, strength=strength)
    heard = put_out(drive_frames(some_drive([board]), 0, 1, [board])[0], board)
    np.testing.assert_allclose(np.abs(heard[0]), strength, atol=0.025)


@pytest.mark.parametrize("divider", [1, 4, 40, 200, 255])
def test_an_off_frame_is_silent_and_may_set_a_divider(divider):
    seen = []
    reader = CommandReader(seen.append)
    reader.read(off_frame(divider))
    assert reader.divider == divider
    reader.read(off_frame())
    assert reader.divider == divider
    assert [one.sounds for one in seen] == [False, False]


@pytest.mark.parametrize("cut", [0, 1, 27, 34, 35, 255, 256, 300, 511])
def test_off_frames_silence_a_board_that_has_a_part_of_a_frame(cut):
    """The buffer is read 512 bytes at a time, as in the firmware; an incomplete rest waits."""
    board, seen = measured_board(), []
    text = drive_frames(some_drive([board]), 0, 1, [board])[0]
    stream = text + text[:cut] + off_frames()
    CommandReader(seen.append).read(stream[: len(stream) // 512 * 512])
    assert seen[0].sounds
    assert not seen[-1].sounds


@pytest.mark.parametrize(("rate", "divider"), [(1000.0, 40), (10_000.0, 4), (40e3 / 255, 255), (500.0, 80)])
def test_rates_are_whole_parts_of_the_carrier(rate, divider):
    assert rate_divider(rate) == divider


@pytest.mark.parametrize(
    ("rate", "said"), [(999.0, "975.61 or 1000 Hz"), (100.0, "at 156.863 Hz"), (40e3, "at 10000 Hz")]
)
def test_other_rates_are_refused_with_the_nearest(rate, said):
    with pytest.raises(RateError, match=said):
        rate_divider(rate)


@pytest.mark.parametrize("repeats", [1, 3])
def test_frames_of_a_file_are_made_a_block_at_a_time_and_are_those_of_the_drive(repeats):
    boards = [measured_board(1), measured_board(2)]
    whole, asked = some_drive(boards, frames=AHEAD + 100), []

    def read(first, last):
        asked.append(last - first)
        return whole.phase[first:last]

    reel = Drive(phase=LazyFrames(read, whole.phase.shape), level=whole.level, rate=1000.0, array=whole.array)
    total, taken, rng = repeats * whole.frames, [], np.random.default_rng(0)
    asked.clear()
    with FramesAhead(reel, boards, total) as frames:
        first = 0
        while first < total:
            count = min(int(rng.integers(1, 60)), total - first)
            taken.append(frames.take(first, count))
            first += count
    for board, text in enumerate(drive_frames(whole, 0, total, boards)):
        assert b"".join(each[board] for each in taken) == text
    assert max(asked) <= AHEAD
    assert sum(asked) == total
