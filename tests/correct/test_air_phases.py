import numpy as np

from midair.correct import correct_air
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics import propagate
from midair.streaming import LazyFrames

ARRAY = TransducerArray.autd3(columns=1, rows=1)
CENTRE = np.array([0.01, -0.02, 0.2])
# Only the speed of sound differs, so that the field at the centre has a closed form: that of the air before.
BEFORE = Acoustics(medium=Medium(speed=345.0), directivity="point")
ROOM = Medium(speed=347.5)


def drive(frames=5):
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, (frames, ARRAY.count))
    return Drive(phase=phase, level=np.full(frames, 0.5), rate=1000.0, array=ARRAY, acoustics=BEFORE)


def test_the_field_at_the_centre_is_that_of_the_air_it_was_solved_for():
    before = drive()
    after = correct_air(before, ROOM, CENTRE)
    wanted = propagate(before, CENTRE[None])
    np.testing.assert_allclose(propagate(after, CENTRE[None]), wanted, rtol=1e-9)
    # Without the correction it is another field.
    uncorrected = propagate(before, CENTRE[None], acoustics=after.acoustics)
    assert np.abs(uncorrected - wanted).max() > 0.1 * np.abs(wanted).max()
    np.testing.assert_array_equal(after.level, before.level)
    assert after.acoustics.medium == ROOM
    assert after.provenance.last("correct_air") == {"from_m_s": 345.0, "to_m_s": 347.5}


def test_lazy_phases_are_corrected_block_by_block():
    whole = drive(50)
    lazy = Drive(
        phase=LazyFrames(lambda first, last: whole.phase[first:last], whole.phase.shape),
        level=whole.level,
        rate=whole.rate,
        array=ARRAY,
        acoustics=BEFORE,
    )
    after = correct_air(lazy, ROOM, CENTRE)
    assert isinstance(after.phase, LazyFrames)
    np.testing.assert_array_equal(np.asarray(after.phase), correct_air(whole, ROOM, CENTRE).phase)


def test_the_same_air_changes_nothing():
    np.testing.assert_allclose(correct_air(drive(), BEFORE.medium, CENTRE).phase, drive().phase, atol=0)
