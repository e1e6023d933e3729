import numpy as np
import pytest

from midair.errors import ShapeError
from midair.model import Drive, Medium, PlayedTouch, Provenance, Solution, TransducerArray

ARRAY = TransducerArray(position=np.eye(3), normal=np.broadcast_to([0.0, 0, 1], (3, 3)))


def made(**changes):
    parts = {"phase": np.zeros((2, 3)), "level": np.ones(2), "rate": 1000.0, "array": ARRAY}
    return Drive(**(parts | changes))


def test_q_is_level_times_a_turn():
    drive = made(phase=np.array([[0, np.pi / 2, np.pi], [0, 0, 0]]), level=np.array([1.0, 0.5]))
    assert drive.q == pytest.approx(np.array([[1, 1j, -1], [0.5, 0.5, 0.5]]))


def test_a_solution_cut_apart_and_joined_is_the_same():
    drive = made(phase=np.arange(15.0).reshape(5, 3), level=np.linspace(0, 1, 5))
    status = ("silent", *("iterations",) * 4)
    whole = Solution(drive=drive, error=np.arange(5.0), iterations=np.arange(5), status=status)
    again = Solution.joined([whole.cut(0, 2), whole.cut(2, 3), whole.cut(3, 5)])
    for one, other in ((again.drive.phase, drive.phase), (again.drive.level, drive.level), (again.error, whole.error)):
        np.testing.assert_array_equal(one, other)
    assert again.iterations.tolist() == [0, 1, 2, 3, 4]
    assert again.status == status
    assert Solution.joined([whole]) is whole


ONE_UNIT = TransducerArray.autd3(columns=1, rows=1)


def played_touch(state, **changes):
    frames = len(state)
    steps = np.arange(frames, dtype=np.uint8)[:, None] * np.ones((1, ONE_UNIT.count), np.uint8)
    values = {"phase_steps": steps, "intensity": np.full(frames, 51, np.uint8), "state": np.array(state, np.int8)}
    values |= {"instant": np.arange(frames, dtype=np.int64), "rate": 1000.0, "array": ONE_UNIT}
    return PlayedTouch(**(values | changes))


def test_what_was_late_or_never_came_is_the_frame_before_which_stood_on():
    drive = played_touch([1, 3, 4, 1, 0, 2]).drive
    assert drive.phase[:, 0] * 256 / (2 * np.pi) == pytest.approx([0, 0, 0, 3, 4, 4])
    assert drive.level == pytest.approx(0.2)


def test_the_drive_of_a_live_take_has_the_air_it_was_solved_for():
    for air, medium in (
        ({"temperature_c": 25.0, "humidity": 0.3, "sound_m_s": 346.8}, Medium.at(temperature=25.0, humidity=0.3)),
        ({"temperature_c": None, "humidity": None, "sound_m_s": 343.0}, Medium(speed=343.0)),
        ({}, Medium()),
    ):
        drive = played_touch([1, 1], provenance=Provenance().then("live", air)).drive
        assert drive.acoustics.medium == medium, air


def test_arrays_are_read_only_and_as_long_as_each_other():
    one = played_touch([1, 1])
    with pytest.raises(ValueError, match="read-only"):
        one.intensity[0] = 3
    with pytest.raises(ShapeError, match="instant"):
        played_touch([1, 1], instant=np.zeros(3, np.int64))
    with pytest.raises(ShapeError, match="phase_steps"):
        played_touch([1, 1], phase_steps=np.zeros((2, 5), np.uint8))
