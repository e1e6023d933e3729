"""A recording on the disk while it runs: cut anywhere, killed, on a disk that fails, and at its end."""

import errno
import os
import random
import shutil
import subprocess
import sys
import threading
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from midair.errors import BrokenFileError, FileError, InputError, NonFiniteError, ShapeError, UnitError
from midair.files import RecordingWriter, contents, load, load_calibration, load_played, open_take, repair, save
from midair.files.native import recording_writer
from midair.files.native.raw_recording import MAGIC
from midair.model import Event, StageStamp, TransducerArray

EVENT = Event(kind="lost", frame=3, frames=2)
STAMP = StageStamp(time=0.1, position=(0.005, -0.06, -0.02), feed=0.05)


def left_by_kill(path, options, *blocks, **more):
    """The bytes of the file while it is written: those that a kill leaves."""
    writer = RecordingWriter(path, **options, **more)
    with writer:
        for block in blocks:
            writer.note([EVENT])
            writer.append(block)
            writer.stamp([STAMP])
        raw = path.read_bytes()
    path.unlink()
    return raw


@pytest.mark.parametrize("stored", ["f8", "f4"])
def test_a_recording_equals_a_saved_one(stored, recording, calibration, options, tmp_path):
    path, samples = tmp_path / "live.h5", recording.samples.astype(stored).astype(np.float64)
    with RecordingWriter(path, **options, calibration=calibration, stored=stored) as writer:
        assert path.read_bytes().startswith(MAGIC)
        for start in range(0, 40, 7):
            writer.append(samples[start : start + 7])
        assert writer.frames == 40
    assert repair(path) == open_take(path).report == ()
    take = open_take(path)
    np.testing.assert_array_equal(take.recording.samples, samples)
    assert take.recording.provenance == recording.provenance
    assert (take.recording.rate, take.recording.sensor) == (recording.rate, recording.sensor)
    kept = load_calibration(path)
    assert kept.identifier == calibration.identifier
    np.testing.assert_array_equal(kept.crosstalk.matrix, calibration.crosstalk.matrix)
    with h5py.File(path) as file:
        assert file["samples"].dtype == f"<{stored}"
        assert file["samples"].fletcher32
    assert [each.name for each in tmp_path.iterdir()] == ["live.h5"]


def test_a_file_that_is_cut_anywhere_gives_the_frames_before_the_cut(recording, options, tmp_path):
    path = tmp_path / "live.h5"
    raw = left_by_kill(path, options, recording.samples[:7], recording.samples[7:10])
    size, found = recording.samples[0].nbytes, set()
    for length in (*range(0, len(raw), 97), *range(len(raw) - 4 * size, len(raw) + 1, 40)):
        path.write_bytes(raw[:length] + b"\0" * (length % 3 * 50))
        try:
            take = open_take(path)
        except BrokenFileError as wrong:
            assert "\n" not in str(wrong)
            continue
        frames = take.recording.frames
        found.add(frames)
        np.testing.assert_array_equal(take.recording.samples, recording.samples[:frames])
        assert take.report == (f"The recording was interrupted: {frames} frames, {0.003 * frames:g} s, are kept.",)
        assert open_take(path).report == (), "it is converted"
    assert found == {7, 10}
    whole = open_take(path)
    assert whole.journal == (EVENT, EVENT)
    assert [step.stage for step in whole.recording.provenance.steps[-2:]] == ["events", "stage"]


def test_every_reader_finds_an_interrupted_recording(recording, calibration, options, tmp_path):
    path = tmp_path / "live.h5"
    raw = left_by_kill(path, options, recording.samples, calibration=calibration)
    for read in (contents, load, load_calibration, load_played, repair):
        path.write_bytes(raw)
        read(path)
        assert load(path).frames == 40
        assert load_calibration(path).identifier == calibration.identifier


def test_frames_of_live_touch_are_cut_with_what_was_played(options, recording, tmp_path):
    array = TransducerArray.autd3(columns=1, rows=1)
    rng = np.random.default_rng(5)
    played = {
        "phase_steps": rng.integers(0, 256, (20, array.count), np.uint8),
        "intensity": rng.integers(0, 256, 20, np.uint8),
        "instant": rng.integers(0, 2**60, 20, np.int64),
        "state": rng.integers(0, 7, 20, np.int8),
    }
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, array=array, played_each=2) as writer:
        for part in (slice(0, 12), slice(12, 20)):
            begin, end = part.start // 2, part.stop // 2
            writer.append(recording.samples[begin:end], {name: values[part] for name, values in played.items()})
        raw = path.read_bytes()
    for length, frames in ((len(raw), 20), (len(raw) - 1, 12)):
        path.write_bytes(raw[:length])
        found = load_played(path)
        for name, values in played.items():
            np.testing.assert_array_equal(getattr(found, name), values[:frames])
        assert found.array.same_as(array)
        assert load(path).frames == frames / 2


def test_frames_need_played_values_only_with_an_array(options, recording, tmp_path):
    array, frames = TransducerArray.autd3(columns=1, rows=1), recording.samples[:4]
    played = {"phase_steps": np.zeros((4, array.count), np.uint8), "intensity": np.zeros(4, np.uint8)}
    played |= {"instant": np.zeros(4, np.int64), "state": np.zeros(4, np.int8)}
    with RecordingWriter(tmp_path / "plain.h5", **options) as file:
        file.append(frames)
        with pytest.raises(FileError, match="without the values played"):
            file.append(frames, played)
    assert load_played(tmp_path / "plain.h5") is None
    writer = RecordingWriter(tmp_path / "take.h5", **options, array=array)
    with writer as file, pytest.raises(FileError, match="with the values played"):
        file.append(frames)


def test_closes_in_order_on_an_error_and_refuses_what_is_wrong(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"

    def fail():
        with RecordingWriter(path, **options) as writer:
            writer.append(recording.samples)
            for block, error in ((np.zeros((2, 5, 3)), ShapeError), (np.full((2, 3, 5), np.nan), NonFiniteError)):
                with pytest.raises(error):
                    writer.append(block)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    alike(load(path), recording)
    with pytest.raises(FileError, match="exists already"), RecordingWriter(path, **options):
        pass
    alike(load(path), recording)
    with pytest.raises(UnitError):
        RecordingWriter(tmp_path / "a.h5", **{**options, "unit": "N"})
    with pytest.raises(FileError, match="create it first"):
        RecordingWriter(tmp_path / "away" / "a.h5", **options)
    with pytest.raises(FileError, match="with block"):
        RecordingWriter(tmp_path / "a.h5", **options).append(recording.samples)
    with pytest.raises(FileError, match=r"on the disk, .* are free; .* record for a shorter time"):
        RecordingWriter(tmp_path / "a.h5", **options, expected=10**15).__enter__()
    with RecordingWriter(tmp_path / "a.h5", **options), pytest.raises(FileError, match="a program is recording"):
        load(tmp_path / "a.h5")
    with RecordingWriter(tmp_path / "b.h5", **options, stored="f4") as writer, pytest.raises(InputError, match="f8"):
        writer.append(recording.samples)
    assert [each.name for each in tmp_path.iterdir()] == ["live.h5"], "no file without frames"


def test_an_interrupt_within_a_write_leaves_no_part_of_it(recording, options, tmp_path, monkeypatch):
    path = tmp_path / "live.h5"

    def interrupted(handle, data):
        os.write(handle, bytes(data)[:60])
        raise KeyboardInterrupt

    with RecordingWriter(path, **options) as writer:
        writer.append(recording.samples[:5])
        monkeypatch.setattr(recording_writer, "os", SimpleNamespace(**vars(os) | {"write": interrupted}))
        with pytest.raises(KeyboardInterrupt):
            writer.append(recording.samples[5:30])
        monkeypatch.undo()
        writer.append(recording.samples[5:7])
    np.testing.assert_array_equal(load(path).samples, recording.samples[:7])


def test_a_running_recording_is_not_replaced(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options) as writer:
        writer.append(recording.samples)
        for replace in (lambda: repair(path), lambda: save(recording, path)):
            with pytest.raises(FileError, match="a program is recording into it; wait until"):
                replace()
    alike(load(path), recording)
    save(recording, path)
    assert sorted(tmp_path.iterdir()) == [path]


def test_stops_before_the_disk_is_full(recording, options, tmp_path, alike):
    with RecordingWriter(tmp_path / "live.h5", **options) as writer:
        writer.append(recording.samples)
        writer.reserve = 2**70
        with pytest.raises(FileError, match=r"on the disk, .* are free; .* 40 frames so far are safe"):
            writer.append(recording.samples)
    alike(load(tmp_path / "live.h5"), recording)


def test_a_recording_that_cannot_be_converted_stays_as_it_is(recording, options, tmp_path, monkeypatch, alike):
    path = tmp_path / "live.h5"
    writer = RecordingWriter(path, **options).__enter__()
    writer.append(recording.samples)
    monkeypatch.setattr("midair.files.native.hdf5.check_disk_space", full)
    with pytest.raises(FileError, match=r"no space; its 40 frames are safe, midair repair converts them"):
        writer.close()
    with pytest.raises(FileError, match="no space"):
        load(path)
    monkeypatch.undo()
    alike(load(path), recording)


def full(*_):
    raise FileError("no space")


@pytest.mark.parametrize("error", [errno.EIO, errno.ENOSPC])
@pytest.mark.parametrize("times", [1, 10**9], ids=["once", "for good"])
def test_a_disk_error_at_any_write_keeps_the_frames_reported_as_safe(error, times, options, tmp_path, monkeypatch):
    for first in range(1, 8):
        path, count = tmp_path / f"{first}.h5", [0]

        def write(handle, data, first=first, count=count):
            count[0] += 1
            if first <= count[0] < first + times:
                os.write(handle, bytes(data)[:20])
                raise OSError(error, os.strerror(error))
            return os.write(handle, data)

        monkeypatch.setattr(recording_writer, "os", SimpleNamespace(**vars(os) | {"write": write}))
        frames, said = 0, ""
        try:
            with RecordingWriter(path, **options) as writer:
                for _ in range(5):
                    writer.append(np.arange(frames, frames + 4)[:, None, None] + np.zeros((4, 3, 5)))
                    frames = writer.frames
        except FileError as wrong:
            said = str(wrong)
        monkeypatch.undo()
        assert (f"{os.strerror(error)}; the {frames} frames so far are safe" in said) == (first < 7)
        assert frames == 4 * min(5, max(0, first - 2))
        assert path.exists() == (frames > 0)
        if frames:
            np.testing.assert_array_equal(load(path).samples[:, 0, 0], np.arange(frames))


WRITE = """
import sys, time
import numpy as np
from midair.errors import FileError
from midair.files import RecordingWriter
from midair.model import Provenance, SensorGrid
path, reserve, pause = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
about = dict(rate=1000, sensor=SensorGrid(), unit="V", provenance=Provenance(source="bench"))
writer = RecordingWriter(path, reserve=reserve, **about)
try:
    with writer:
        for first in range(0, 200_000, 20):
            print(first, flush=True)
            writer.append(np.arange(first, first + 20)[:, None, None] + np.zeros((1, 4, 4)))
            time.sleep(pause)
except FileError as wrong:
    print(wrong)
    print(writer.frames)
"""


@pytest.mark.long
def test_twenty_kills_at_random_moments_lose_no_frame_that_was_appended(tmp_path):
    chance, counts = random.Random(20), []
    for number in range(20):
        path = tmp_path / f"{number}.h5"
        words = [sys.executable, "-c", WRITE, path, "0", "0.001"]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
            program.stdout.readline()
            killer = threading.Timer(chance.uniform(0, 0.4), program.kill)
            killer.start()
            lines = [line for line in program.stdout if line.endswith("\n")]
            killer.join()
        appended = int(lines[-1]) if lines else 0
        frames = load(path).frames if appended or path.stat().st_size > 4000 else 0
        assert appended <= frames <= appended + 20
        counts.append(frames)
        if frames:
            np.testing.assert_array_equal(load(path).samples[:, 0, 0], np.arange(frames))
        (path.unlink if path.exists() else str)()
    assert max(counts) > 200


@pytest.fixture
def tiny_disk(tmp_path):
    """A disk in memory of that many kB."""
    made = []

    def mount(size):
        folder = tmp_path / f"disk{size}"
        folder.mkdir()
        words = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(folder)]
        if shutil.which("mount") is None or subprocess.run(words, capture_output=True, check=False).returncode:
            pytest.skip("only root may mount a disk of a chosen size")
        made.append(folder)
        return folder

    yield mount
    for folder in made:
        subprocess.run(["umount", str(folder)], check=True)


def written_in(path, *, reserve, **how):
    """The last message of a program that writes as much as possible, and the number of frames that it reports."""
    words = [sys.executable, "-c", WRITE, path, str(reserve), "0"]
    done = subprocess.run(words, text=True, capture_output=True, check=True, **how)
    assert done.stderr == ""
    said, frames = done.stdout.splitlines()[-2:]
    return said, int(frames)


@pytest.mark.long
@pytest.mark.parametrize(("size", "reserve"), [(4, 2**24), (16384, 2**24), (4, 0), (128, 0), (512, 0), (2048, 0)])
def test_a_full_disk_keeps_the_frames_reported_as_safe(size, reserve, tiny_disk, tmp_path):
    folder = tiny_disk(size)
    said, frames = written_in(folder / "live.h5", reserve=reserve)
    assert " on the disk, " in said or "No space left on device" in said
    assert [each.name for each in folder.iterdir()] == ["live.h5"] * (frames > 0)
    assert (frames > 0) == (reserve == 0 and size > 100)
    if frames:
        shutil.copy(folder / "live.h5", tmp_path / "copy.h5")
        np.testing.assert_array_equal(load(tmp_path / "copy.h5").samples[:, 0, 0], np.arange(frames))


@pytest.mark.long
@pytest.mark.parametrize("limit", [0, 64, 512])
def test_a_file_size_limit_keeps_the_safe_frames(limit, tmp_path):
    """As of a shell's ulimit -f, or of 4 GB on FAT32."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "live.h5"
    size = limit * 1024
    said, frames = written_in(
        path, reserve=2**24, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    )
    assert "File too large" in said
    assert path.exists() == (frames > 0)
    assert frames * 16 * 8 >= 0.9 * size - 4000
    if frames:
        np.testing.assert_array_equal(load(path).samples[:, 0, 0], np.arange(frames))


def test_written_frames_are_flushed_to_the_disk_after_each_interval(recording, options, tmp_path, monkeypatch):
    now, flushed = [100.0], []
    monkeypatch.setattr(recording_writer, "time", SimpleNamespace(monotonic=lambda: now[0]))
    watched = SimpleNamespace(**vars(os) | {"fsync": lambda _: flushed.append(now[0])})
    monkeypatch.setattr(recording_writer, "os", watched)
    with RecordingWriter(tmp_path / "live.h5", **options) as writer:
        for _ in range(20):
            now[0] += 0.05
            writer.append(recording.samples[:1])
    assert np.diff([*flushed, now[0]]).max() <= 0.25 + 1e-9
