import numpy as np
import pytest

from midair.model import SensorGrid
from midair.physics import transfer_matrix
from midair.rig import FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED, LiveSettings
from midair.studio.live_run import LiveView, RecentFrames
from midair.view import Kind

SLOT = np.dtype(
    [
        ("number", "i8"),
        ("samples", "f8", (64,)),
        ("pressure", "f8", (64,)),
        ("phases", "u1", (996,)),
        ("intensity", "u1"),
        ("flags", "u1"),
        ("instant", "i8"),
    ]
)


class LoopStarted:
    """The fields of `LoopStarted` that these tests need."""

    rate, schedule = 1000.0, LiveSettings().schedule(1000.0)
    sensor = SensorGrid()


def frames(first, count, seed=3):
    random = np.random.default_rng(seed)
    found = np.zeros(count, SLOT)
    found["number"] = np.arange(first, first + count)
    found["samples"][:, :16] = random.normal(size=(count, 16))
    found["pressure"][:, :16] = random.normal(size=(count, 16))
    found["phases"] = random.integers(0, 256, (count, 996))
    found["intensity"], found["flags"] = 255, FRAME_EMITTED
    return found


@pytest.fixture(scope="module")
def sight():
    made = LiveView(LiveSettings())
    made.found(LoopStarted)
    return made


def test_sound_field_is_that_of_the_phases_in_pascal(sight):
    found = frames(100, 3)
    q = np.exp(2j * np.pi * found["phases"] / 256)
    expected = q @ transfer_matrix(sight.grid, sight.array, acoustics=LiveSettings().acoustics).T
    assert np.abs(sight.sound(found) - expected).max() < 1e-3 * np.abs(expected).max()


def test_late_and_held_frames_repeat_the_previous_field(sight):
    before = sight.sound(frames(0, 4))
    found = frames(4, 5, seed=4)
    found["flags"][[0, 3]] = FRAME_EMITTED | FRAME_LATE, FRAME_REPEATED
    sound = sight.sound(found)
    assert np.array_equal(sound[0], before[-1])
    assert np.array_equal(sound[3], sound[2])
    assert not np.array_equal(sound[4], sound[3])


def test_every_frame_is_sent_once_and_phases_sometimes(sight):
    kinds = []
    for first in range(0, 1000, 8):
        felt, sound, *phases = sight.sections(frames(1000 + first, 8))
        assert felt.first == sound.first == 1000 + first
        assert (felt.values.shape, sound.values.shape) == ((8, 16), (8, 512))
        assert (felt.values.dtype, sound.values.dtype) == (np.int16, np.int8)
        kinds += [each.kind for each in phases]
    assert kinds == [Kind.PHASES] * len(kinds)
    assert 13 <= len(kinds) <= 16


def test_at_most_a_minute_is_kept():
    kept = RecentFrames(16, 996, 100)
    assert len(kept.last(10)) == 0
    for first in range(0, 400, 8):
        kept.add(frames(first, 8, seed=first))
    assert 100 <= kept.frames < 108
    found = kept.last(100)
    assert len(found) == 100
    last = frames(392, 8, seed=392)
    assert np.array_equal(found["samples"][-8:], last["samples"][:, :16])
    for name in ("phases", "number"):  # a take is aligned to the sensor's frames by their numbers
        assert np.array_equal(found[name][-8:], last[name])
