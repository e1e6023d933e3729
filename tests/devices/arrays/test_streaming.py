import pytest

from midair.devices.arrays.banks import UnitsState
from midair.devices.arrays.streaming import FrameCapture
from midair.errors import DeviceError, LinkLostError, SilentFramesError, TooHotError

MS = 1_000_000


class Answers:
    failsafe = 0.5

    def __init__(self):
        self.instant, self.answer = 0, UnitsState()

    def now(self):
        return self.instant

    def state(self):
        return self.answer


def heard(blocks, total=1000):
    """Units and record after blocks of 250 frames at 1 kHz, each on time and confirmed half a frame later."""
    units = Answers()
    one = FrameCapture(units, MS, total)
    for block in range(blocks):
        one.add_block(250 * block * MS, 250, planned=250 * block * MS)
        units.instant = 250 * block * MS + MS // 2
        one.query()
    return units, one


def test_frames_are_silent_from_half_a_second_after_the_last_good_answer_also_within_a_block():
    units, one = heard(2)  # the last good answer came at 250.5 ms, so that 750 frames are sure to have sounded
    one.add_block(500 * MS, 250, planned=500 * MS)
    one.add_block(1250 * MS, 250, planned=750 * MS)  # late, after a hang
    units.instant, units.answer = 1251 * MS, UnitsState(silenced=(1,))
    with pytest.raises(SilentFramesError, match=r"unit 1: frames 750 to 999 of 1000 \(0\.750 to 1\.000 s\)"):
        one.query()
    units, one = heard(3)  # well at 500.5 ms: until 1000.5 ms
    one.add_block(750 * MS, 100, planned=750 * MS)
    one.add_block(900 * MS, 150, planned=850 * MS)  # 50 ms late: its frame 850 + 100 ends at 1001 ms
    units.instant, units.answer = 1600 * MS, UnitsState(silenced=(0, 1))
    with pytest.raises(SilentFramesError, match=r"units 0, 1: frames 950 to 999"):
        one.query()


def test_a_failsafe_after_the_last_frame_harms_nothing():
    units, one = heard(4)
    units.instant, units.answer = 1600 * MS, UnitsState(silenced=(0,), errors=("unit 0 counted failsafe 1 times",))
    one.query()
    assert one.units() == "not too hot, unit 0 counted failsafe 1 times"
    units.answer = None  # units without a state report nothing
    one.query()
    assert one.units() == ""


def test_an_error_that_ends_a_stream_lists_the_uncertain_frames():
    _, one = heard(2)  # nothing is known of what came after 250.5 ms
    wrong = one.with_frames(LinkLostError("a cable"))
    assert type(wrong) is LinkLostError
    assert str(wrong) == "a cable; frames 250 to 999 of 1000 (0.250 to 1.000 s) may not have sounded"
    _, done = heard(1, total=0)
    assert str(done.with_frames(DeviceError("at the end"))) == "at the end"
    _, one = heard(0)
    assert str(one.with_frames(DeviceError("refused"))).startswith("refused; frames 0 to 999 of 1000")


@pytest.mark.parametrize("method", ["query", "check_heat"])
def test_a_hot_unit_ends_the_stream_and_the_error_names_unit_and_frame(method):
    units, one = heard(1)
    one.add_block(250 * MS, 250, planned=250 * MS)
    units.instant, units.answer = 300 * MS, UnitsState(hot=(2, 3), silenced=(0,))
    with pytest.raises(
        TooHotError, match=r"got units 2, 3 too hot after 300 of 1000 frames \(0\.300 s\); let them cool"
    ):
        getattr(one, method)()
