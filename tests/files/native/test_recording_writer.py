import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import xarray
from tests.waiting import wait_until

from midair.errors import FileError, InputError, NonFiniteError, ShapeError, UnitError
from midair.files import RecordingWriter, load, load_calibration, open_take, repair
from midair.model import Provenance, SensorGrid


@pytest.mark.long
def test_a_live_recording_equals_a_saved_one(recording, calibration, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, calibration=calibration) as writer:
        for start in range(0, 40, 7):
            writer.append(recording.samples[start : start + 7])
        assert writer.frames == 40
    assert open_take(path).report == ()
    alike(load(path), recording)
    assert load_calibration(path) is not None
    with xarray.open_dataset(path, engine="h5netcdf") as table:
        np.testing.assert_array_equal(table.samples, recording.samples)
        assert table.sizes == {"time": 40, "row": 3, "column": 5, "event": 0}


def test_can_be_read_while_it_grows(recording, options, tmp_path):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, interval=1e-3) as writer:
        writer.append(recording.samples[:10])
        time.sleep(0.05)
        seen = open_take(path)
        np.testing.assert_array_equal(seen.recording.samples, recording.samples[:10])
        assert "not closed" in seen.report[0]
        writer.append(recording.samples[10:])
    assert load(path).frames == 40


def test_a_late_block_does_not_keep_an_early_one_in_memory(recording, options, tmp_path):
    """The first block after a flush waits for the timer, not for the next block."""
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, interval=0.05) as writer:
        writer.append(recording.samples[:10])
        wait_until(lambda: frames_on_disk(path) >= 10, 5)
        assert frames_on_disk(path) == 10
        assert writer.frames == 10


def frames_on_disk(path):
    try:
        return open_take(path).recording.frames
    except FileError:
        return 0


def test_closes_in_order_on_an_error(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    before = set(threading.enumerate())

    def fail():
        with RecordingWriter(path, **options) as writer:
            writer.append(recording.samples)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert open_take(path).report == ()
    alike(load(path), recording)
    started = set(threading.enumerate()) - before
    assert not [thread for thread in started if isinstance(thread, threading.Timer) and not thread.finished.is_set()]


def test_leaves_an_earlier_recording_alone(options, tmp_path):
    path = tmp_path / "live.h5"
    path.write_bytes(b"precious")
    with pytest.raises(FileError, match="exists already"), RecordingWriter(path, **options):
        pass
    assert path.read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("block", "error"), [(np.zeros((2, 5, 3)), ShapeError), (np.full((2, 3, 5), np.nan), NonFiniteError)]
)
def test_refuses_a_block_and_writes_nothing_of_it(block, error, recording, options, tmp_path, alike):
    with RecordingWriter(tmp_path / "live.h5", **options) as writer:
        writer.append(recording.samples)
        with pytest.raises(error):
            writer.append(block)
    alike(load(tmp_path / "live.h5"), recording)


def test_stops_before_the_disk_is_full(recording, options, tmp_path, alike):
    with RecordingWriter(tmp_path / "live.h5", **options) as writer:
        writer.append(recording.samples)
        writer.reserve = 2**70
        with pytest.raises(FileError, match=r"MB free on the disk, got .* 40 frames so far are safe"):
            writer.append(recording.samples)
    alike(load(tmp_path / "live.h5"), recording)


def test_refuses_wrong_options_before_it_makes_a_file(options, tmp_path):
    with pytest.raises(UnitError):
        RecordingWriter(tmp_path / "live.h5", **{**options, "unit": "N"})
    with pytest.raises(FileError, match="create it first"):
        RecordingWriter(tmp_path / "away" / "live.h5", **options)
    assert list(tmp_path.iterdir()) == []


def test_is_closed_outside_of_its_context(recording, options, tmp_path):
    writer = RecordingWriter(tmp_path / "live.h5", **options)
    with pytest.raises(FileError, match="with block"):
        writer.append(recording.samples)


def test_refuses_a_recording_without_frames(options, tmp_path):
    with RecordingWriter(tmp_path / "live.h5", **options):
        pass
    with pytest.raises(ValueError, match="samples: expected axes"):
        load(tmp_path / "live.h5")


KILLED = """
import sys, time
import numpy as np
from midair.model import Calibration, Provenance, SensorGrid
from midair.files import RecordingWriter
sensor = SensorGrid()
options = dict(rate=1000, sensor=sensor, unit="V", provenance=Provenance(source="bench"))
with RecordingWriter(sys.argv[1], calibration=Calibration.flat(sensor), **options) as writer:
    start = time.monotonic()
    while True:
        frame = np.arange(writer.frames, writer.frames + 20)
        writer.append(frame[:, None, None] + np.arange(16).reshape(4, 4) / 16)
        print(time.monotonic(), writer.frames, flush=True)
        time.sleep(max(0, start + writer.frames / 1000 - time.monotonic()))
"""


@pytest.mark.long
@pytest.mark.parametrize("seconds", [0.35, pytest.param(0.8, marks=pytest.mark.long)])
def test_a_killed_program_loses_at_most_a_quarter_of_a_second(seconds, tmp_path):
    path = tmp_path / "live.h5"
    with subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        first = program.stdout.readline()
        time.sleep(seconds)
        killed = time.monotonic()
        program.kill()
        lines = [first, *program.stdout]
    appended = [(float(when), int(frames)) for when, frames in (line.split() for line in lines if line.endswith("\n"))]
    # A quarter of a second is the writer's interval; the rest allows for a busy machine.
    safe = max((frames for when, frames in appended if when < killed - 0.25 - 0.15), default=0)
    seen = open_take(path)
    frames = seen.recording.frames
    assert safe <= frames <= appended[-1][1] + 20
    np.testing.assert_array_equal(
        seen.recording.samples, np.arange(frames)[:, None, None] + np.arange(16).reshape(4, 4) / 16
    )
    assert "was killed" in seen.report[0]
    assert repair(path) == seen.report
    assert load(path).frames == frames
    assert load(path).provenance == Provenance(source="bench")
    assert load_calibration(path).sensor == SensorGrid()
    with xarray.open_dataset(path, engine="h5netcdf") as table:
        assert table.sizes["time"] == frames


def test_no_file_is_made_where_there_is_no_room_for_what_will_come(options, tmp_path):
    with pytest.raises(FileError, match=r"free on the disk, got .* record for a shorter time"):
        RecordingWriter(tmp_path / "live.h5", **options, expected=10**15).__enter__()
    assert list(tmp_path.iterdir()) == []


def test_float32_samples_take_half_the_space(recording, options, tmp_path):
    samples = recording.samples.astype(np.float32).astype(np.float64)
    with RecordingWriter(tmp_path / "live.h5", **options, stored="f4") as writer:
        writer.append(samples)
        with pytest.raises(InputError, match="float32 holds"):
            writer.append(samples + 1e-12)
        writer.append(samples)
    seen = open_take(tmp_path / "live.h5", streamed=True).recording.samples
    assert seen.stored == "f4"
    np.testing.assert_array_equal(seen, np.concatenate([samples, samples]))
