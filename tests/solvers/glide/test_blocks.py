"""Blocks: each frame is solved once, after its neighbours."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from midair.solvers.glide import blocks, midpoints

SIZES = {"frames": st.integers(1, 400), "coarse": st.integers(1, 40), "size": st.integers(1, 150)}


@given(**SIZES)
def test_all_frames_are_solved_once_and_after_their_neighbours_between_marks_as_near_as_was_asked(frames, coarse, size):
    times = np.zeros(frames, int)
    for block in blocks(frames, coarse=coarse, size=size):
        times[block.marks] += 1
        marks = block.marks if block.leads else np.concatenate([[block.first], block.marks])
        assert times[marks].all()
        for level in midpoints(marks):
            assert times[level[:, [0, 2]]].all()
            assert (np.diff(level, axis=1) > 0).all()
            times[level[:, 1]] += 1
    assert (times == 1).all()
    marks = np.concatenate([block.marks for block in blocks(frames, coarse=coarse, size=size)])
    assert marks[0] == 0
    assert marks[-1] == frames - 1
    assert np.diff(marks).max(initial=0) <= coarse


def test_whole_blocks_do_not_depend_on_later_frames():
    def first_two(frames):
        return [(one.first, one.last, one.marks.tolist()) for one in list(blocks(frames, coarse=10, size=40))[:2]]

    assert first_two(100) == first_two(101) == first_two(160) == first_two(1000)


def test_a_block_begins_where_the_one_before_it_ends_and_the_first_is_as_short_as_was_asked():
    first, second, *_ = blocks(5000, coarse=512, size=1024, opening=256)
    assert (first.last, first.marks.tolist(), second.marks.tolist()) == (256, [0, 256], [768, 1280])
    every = list(blocks(1000, coarse=32, size=100))
    assert [one.last for one in every[:-1]] == [one.first for one in every[1:]]
    assert [one.leads for one in every] == [True] + [False] * (len(every) - 1)
