"""Takes: the file holds the sensor's frames, lost frames are marked, and every end is reported."""

from pathlib import Path

import numpy as np
import pytest

from midair.devices import FrameBlock, ReplaySensor
from midair.errors import DeviceError
from midair.files import load, repair
from midair.model import Recording
from midair.rig.takes.take import Subject, last_subject, record_take, store_subject, take_name, take_path
from midair.rig.takes.take_state import RecordSettings

RATE = 1000.0
COUNT = Recording(samples=np.arange(1000 * 16.0).reshape(1000, 4, 4), rate=RATE)
"""Frame i, channel c holds 16 i + c."""


class Watcher:
    """Gives commands at set times, and stores the reported events."""

    def __init__(self, orders=()):
        self.orders, self.asked = dict(orders), -1
        self.told, self.views = [], []

    def order(self):
        self.asked += 1
        return self.orders.get(self.asked)

    def show(self, view):
        self.views.append(view)

    def tell(self, event, drift=None):
        self.told.append(event)

    def kinds(self):
        return [event.kind for event in self.told]


class Leaky(ReplaySensor):
    """A sensor in real time that loses some frames: gaps = {first lost frame: how many}."""

    on_demand = False

    def __init__(self, recording, gaps, **options):
        super().__init__(recording, **options)
        self._gaps = gaps

    def read(self, frames):
        begin = self._taken
        if begin in self._gaps:
            begin = self._taken = begin + self._gaps[begin]
        following = [first for first in self._gaps if first > begin]
        block = super().read(min([frames, *(first - begin for first in following)]))
        return FrameBlock(
            samples=block.samples, first=block.first, device_time=block.first / RATE, host_time=begin / RATE
        )


def take(sensor, path, watcher=None, *, notes=None, key=False, block=0.05, **settings):
    with sensor:
        chosen = RecordSettings(**settings)
        return record_take(sensor, chosen, watcher or Watcher(), path=path, notes=notes, key=key, block=block)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "take.h5"


def test_lost_frames_are_repeated_reported_and_stored(path):
    """Frames 100 to 102 and 500 to 539 never come: frame i of the file is still frame i of the sensor."""
    watcher = Watcher()
    made = take(Leaky(COUNT, {100: 3, 500: 40}), path, watcher, notes={"object": "towel"})
    expected = COUNT.samples.copy()
    expected[100:103], expected[500:540] = expected[99], expected[499]
    np.testing.assert_array_equal(load(path).samples, expected)
    assert (made.frames, made.lost, made.end, made.problem) == (1000, 43, "source", "")
    assert (made.lowest, made.highest) == (0, 15999)
    assert load(path).provenance.notes == {"object": "towel"}
    assert [(event.kind, event.frame, event.frames) for event in watcher.told] == [("lost", 100, 3), ("lost", 500, 40)]
    step = load(path).provenance.steps[-1]
    assert step.stage == "events"
    assert step.settings["lost_frames"] == 43
    assert step.settings["lost"] == ((100, 3), (500, 40))
    repair(path)
    assert load(path).provenance.steps == (step,), "a repaired file says it once"


def test_frames_lost_at_the_beginning_hold_the_first_good_one_and_a_gap_at_the_end_counts_to_the_end(path):
    made = take(Leaky(COUNT, {0: 7, 190: 100}), path, duration=0.2)
    samples = load(path).samples
    np.testing.assert_array_equal(samples[:8], np.broadcast_to(COUNT.samples[7], (8, 4, 4)))
    assert (made.frames, made.lost) == (200, 17)
    assert load(path).provenance.steps[-1].settings["lost"] == ((0, 7), (190, 10))


def test_keys_start_and_stop(path):
    """Blocks of 50 frames: three are read while waiting, 100 frames of them are kept, five more until the stop."""
    sensor = ReplaySensor(COUNT)
    sensor.on_demand = False
    watcher = Watcher({3: "toggle", 7: "toggle"})
    made = take(sensor, path, watcher, key=True, pre_roll=0.1)
    assert (made.frames, made.end) == (100 + 250, "toggle")
    np.testing.assert_array_equal(load(path).samples, COUNT.samples[50:400])
    assert [view.state for view in watcher.views] == ["waiting"] * 3 + ["recording"] * 5


@pytest.mark.long
def test_time_stands_still_while_a_replay_waits_for_a_key(path):
    made = take(ReplaySensor(COUNT), path, Watcher({3: "toggle"}), key=True, block=0.01)
    assert (made.frames, made.end) == (1000, "source")


def test_quit_while_waiting_makes_no_file(path):
    made = take(ReplaySensor(COUNT), path, Watcher({2: "quit"}), key=True, block=0.01)
    assert (made.path, made.frames, made.end) == (None, 0, "quit")
    assert not path.exists()


def touched(*spans, frames=3000):
    """A quiet sensor at 2 V of rest that one channel touches by 1 V during spans of frames."""
    samples = np.random.default_rng(0).normal(2.0, 0.01, (frames, 4, 4))
    for first, last in spans:
        samples[first:last, 2, 1] += 1.0
    return Recording(samples=samples, rate=RATE)


def test_a_touch_starts_with_what_came_before_and_silence_ends_it(path):
    source, watcher = touched((1234, 1500)), Watcher()
    made = take(ReplaySensor(source), path, watcher, level=0.5, pre_roll=0.1, post_roll=0.3)
    assert made.end == "quiet"
    assert 0 <= made.frames - (100 + 266 + 300) < 50, "the end comes with the block in which it is quiet for .3 s"
    np.testing.assert_array_equal(load(path).samples, source.samples[1134 : 1134 + made.frames])
    assert load(path).provenance.steps[-1].settings["trigger"] == 100
    assert load(path).provenance.steps[0].settings == {"start": "touch", "level": 0.5, "pre_roll_s": 0.1}


@pytest.mark.parametrize(("touch", "kept"), [(1234, slice(1034, 1734)), (30, slice(0, 530))])
def test_a_duration_counts_from_the_touch_before_which_the_pre_roll_keeps_what_there_is(touch, kept, path):
    source = touched((touch, touch + 200))
    made = take(ReplaySensor(source), path, level=0.5, pre_roll=0.2, duration=0.5)
    assert made.end == "duration"
    np.testing.assert_array_equal(load(path).samples, source.samples[kept])


def test_a_loss_in_the_pre_roll_is_noted_where_it_is_in_the_file(path):
    source = touched((1234, 1500))
    made = take(Leaky(source, {100: 5, 1200: 10}), path, level=0.5, pre_roll=0.1, duration=0.5)
    assert made.lost == 10
    assert load(path).provenance.steps[-1].settings["lost"] == ((1200 - 1134, 10),)


def test_clipping_dead_and_stuck_channels_are_reported_and_stored(path):
    rng = np.random.default_rng(1)
    samples = rng.normal(0, 0.1, (2000, 4, 4))
    samples[:, 0, 3] = 0.25  # channel 3 is dead
    samples[700:, 1, 2] = samples[699, 1, 2]  # channel 6 stops at frame 699
    samples[1000:1010, 3, 3] = 5.0  # channel 15 clips for ten frames
    sensor, watcher = ReplaySensor(Recording(samples=samples, rate=RATE)), Watcher()
    sensor.full_scale = 5.0
    made = take(sensor, path, watcher)
    assert made.levels.dead.nonzero()[0].tolist() == [3]
    assert made.levels.stuck.nonzero()[0].tolist() == [6]
    assert made.levels.clipped[15] == 10
    assert made.levels.clipped.sum() == 10
    settings = load(path).provenance.steps[-1].settings
    assert settings["dead"] == ((3, 0),)
    assert settings["stuck"] == ((6, 699),)
    assert settings["clipped"] == ((15, 1000, 10),)
    assert sorted(watcher.kinds()) == ["clipped", "dead", "stuck"], "each is told once"


class Unplugged(ReplaySensor):
    def read(self, frames):
        if self._taken >= 400:
            raise DeviceError("bench: unplugged")
        return super().read(frames)


def test_frames_before_the_loss_of_the_sensor_are_kept_and_without_any_there_is_no_file(path):
    made = take(Unplugged(COUNT), path)
    assert (made.frames, made.end, made.problem) == (400, "failure", "bench: unplugged")
    np.testing.assert_array_equal(load(path).samples, COUNT.samples[:400])
    path.unlink()
    with pytest.raises(DeviceError, match="unplugged"):
        take(Unplugged(COUNT), path, level=1e6)
    assert not path.exists()


def test_a_full_disk_ends_the_take_and_keeps_it(path, monkeypatch):
    watcher, source = Watcher(), ReplaySensor(COUNT)

    def show(view):
        if view.frames >= 200:
            monkeypatch.setattr(
                "midair.files.native.recording_writer.shutil.disk_usage", lambda _: type("Disk", (), {"free": 0})
            )

    watcher.show = show
    made = take(source, path, watcher)
    assert (made.frames, made.end) == (200, "failure")
    assert "needs 16.8 MB on the disk, 0 bytes are free" in made.problem
    monkeypatch.undo()
    assert load(path).frames == 200


def test_a_sensor_that_gives_nothing_is_an_error(path):
    sensor = ReplaySensor(COUNT)
    sensor.read = lambda frames: FrameBlock(samples=np.zeros((0, 4, 4)), first=0, device_time=0, host_time=0)
    with pytest.raises(DeviceError, match="expected frames, got none"):
        take(sensor, path)
    assert not path.exists()


class Fast(ReplaySensor):
    """Gives 1000 frames a second by its own count, in 1 / 1.003 s of this computer's time."""

    on_demand = False

    def read(self, frames):
        block = super().read(frames)
        late = 1e-3 * (block.first // 50 % 3)
        return FrameBlock(
            samples=block.samples,
            first=block.first,
            device_time=block.first / RATE * 1.001,
            host_time=block.first / RATE / 1.003 + late,
        )


@pytest.mark.long
def test_clock_drift_is_reported_once_and_stored(path):
    long = Recording(samples=np.random.default_rng(2).normal(size=(20_000, 1, 1)), rate=RATE, sensor=_one())
    watcher = Watcher()
    made = take(Fast(long), path, watcher)
    assert made.rate is not None
    assert made.clock is not None
    assert made.rate.ppm == pytest.approx(3000, abs=max(made.rate.uncertainty, 1))
    assert made.clock.ppm == pytest.approx(1.001 * 1.003e6 - 1e6, abs=max(made.clock.uncertainty, 1))
    assert sorted(watcher.kinds()) == ["clock", "rate"]
    settings = load(path).provenance.steps[-1].settings
    assert settings["rate_ppm"] == made.rate.ppm
    assert settings["clock_ppm"] == made.clock.ppm


def _one():
    from midair.model import SensorGrid

    return SensorGrid(rows=1, columns=1)


def test_names_count_on_and_never_fill_a_gap(tmp_path):
    towel = Subject(object="Towel", surface="flat")
    assert take_path(tmp_path, towel, repeats=5) == tmp_path / "towel-flat-01.h5"
    for name in ("towel-flat-01.h5", "towel-flat-03.h5", "towel-99.h5", "towel-flat-04.txt", "towel-flat-x.h5"):
        (tmp_path / name).touch()
    assert take_path(tmp_path, towel, repeats=5) == tmp_path / "towel-flat-04.h5"
    (tmp_path / "towel-flat-99.h5").touch()
    assert take_name(tmp_path, "towel-flat") == tmp_path / "towel-flat-100.h5"
    assert take_path(tmp_path / "a.h5", Subject(), repeats=1) == tmp_path / "a.h5"
    assert take_path(tmp_path / "a.h5", Subject(), repeats=2) == tmp_path / "a-01.h5"


def test_stems_are_fit_for_a_file_name(subtests):
    for subject, stem in [
        (Subject(), "recording"),
        (Subject(object="Brush, soft"), "brush_soft"),
        (Subject(surface="flat"), "flat"),
        (Subject(object="Bürste/Ä", surface="../.."), "bürste_ä"),
        (Subject(object="a" * 500), "a" * 60),
        (Subject(object="タオル", surface="1.5 mm"), "タオル-1.5_mm"),
    ]:
        with subtests.test(subject=subject):
            assert subject.stem == stem
            assert Path(subject.stem).name == subject.stem


def test_the_last_subject_is_remembered(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    assert last_subject() == Subject()
    towel = Subject(object="towel", surface="flat", operator="Å")
    store_subject(towel)
    assert last_subject() == towel
    for broken in ("{", "[]", '"x"', '{"object": 3}'):
        (tmp_path / "state" / "subject.json").write_text(broken)
        assert last_subject() in (Subject(), Subject(object="3"))
