import numpy as np

from midair.rig.live_touch.touch_ring import STEP, TouchRing

SHAPE = 8, 4, 6


def written(ring, numbers):
    for number in numbers:
        slot = ring.next_slot()
        slot["number"], slot["samples"], slot["phases"] = number, number, number
        ring.publish()


def test_gives_every_frame_once_and_in_order_and_a_slow_reader_the_number_of_missed_ones():
    ring, seen, got = TouchRing(*SHAPE), 0, []
    for first in range(0, 30, 5):
        written(ring, range(first, first + 5))
        found, seen, missed = ring.since(seen)
        assert missed == 0
        assert (found["phases"] == found["number"][:, None]).all()
        got += found["number"].tolist()
    assert got == list(range(30))
    assert len(ring.since(seen)[0]) == 0
    ring = TouchRing(*SHAPE)
    written(ring, range(20))
    found, seen, missed = ring.since(3)
    # The oldest slot may be the one that is being written.
    assert found["number"].tolist() == list(range(13, 20))
    assert (seen, missed) == (20, 10)


def test_is_one_memory_wherever_it_is():
    ring = TouchRing(*SHAPE)
    other = TouchRing.__new__(TouchRing)
    other.__setstate__(ring.__getstate__())
    written(ring, [7])
    ring.add("lost", 3)
    ring.time("left", 3.2 * STEP)
    ring.time("left", 1e9)
    assert other.since(0)[0]["number"].tolist() == [7]
    assert other.count("lost") == 3
    assert np.flatnonzero(other.histogram("left")).tolist() == [3, 999]
    other.end()
    assert ring.ends


def test_misses_are_counted_in_tenths_of_the_run():
    ring = TouchRing(*SHAPE)
    for name, second in (("late", 0.5), ("late", 0.9), ("lost", 3.2), ("gaps", 19.9)):
        ring.miss(name, second)
    halves = ring.over_time(20.0)
    assert halves == {
        "late": (2, 0, 0, 0, 0, 0, 0, 0, 0, 0),
        "lost": (0, 1, 0, 0, 0, 0, 0, 0, 0, 0),
        "gaps": (0, 0, 0, 0, 0, 0, 0, 0, 0, 1),
    }
    # A run that is shorter, or longer than the memory of the ring, loses none.
    for seconds in (0.0, 3.0, 1e6):
        assert [sum(parts) for parts in ring.over_time(seconds).values()] == [2, 1, 1]
