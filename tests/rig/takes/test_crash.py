"""A recording whose program is killed: the file opens, and at most a quarter of a second is gone.

The killed program is a real process with a sensor that runs by the clock. It writes into shared memory, for each block,
how many frames the source has given; that is what the file is held against.
"""

import mmap
import os
import random
import re
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest

from midair.cli import run
from midair.errors import BrokenFileError
from midair.files import load, open_take, repair, save
from midair.model import Recording

RATE = 1000
MIDAIR = (sys.executable, "-c", "from midair.cli import main; main()")

PROGRAM = """
import mmap, struct, sys, time
import numpy as np
from pathlib import Path
from midair.devices import FrameBlock, SensorDevice
from midair.model import SensorGrid
from midair.rig import RecordSettings, TakeObserver, record_take


class Clock(SensorDevice):
    name, grid, rate, unit = "clock", SensorGrid(), 1000.0, "V"

    def __init__(self, given):
        self.given = given

    def stop(self): ...

    def start(self):
        self.taken, self.begin = 0, time.monotonic()
        struct.pack_into("d", self.given, 8, self.begin)

    def read(self, frames):
        first, self.taken = self.taken, self.taken + frames
        time.sleep(max(0, self.begin + self.taken / 1000 - time.monotonic()))
        samples = np.arange(first, self.taken)[:, None, None] + np.arange(16).reshape(4, 4) / 16
        struct.pack_into("q", self.given, 0, self.taken)
        return FrameBlock(samples=samples, first=first, device_time=first / 1000, host_time=self.begin + first / 1000)


with open(sys.argv[2], "r+b") as file, Clock(mmap.mmap(file.fileno(), 16)) as sensor:
    record_take(sensor, RecordSettings(), TakeObserver(), path=Path(sys.argv[1]))
"""


def killed_after(seconds, folder, *, minimum=0):
    """Kill a recording so long after its sensor started: frames that were given, frames that were sampled, the file.

    A busy machine may keep the program from running: no sooner than `minimum` frames were given.
    """
    path, shared = folder / "take.h5", folder / "given"
    shared.write_bytes(bytes(16))
    with shared.open("r+b") as file, mmap.mmap(file.fileno(), 16) as given:
        with subprocess.Popen([sys.executable, "-c", PROGRAM, path, shared]) as program:
            while not (begin := struct.unpack_from("d", given, 8)[0]):
                assert program.poll() is None
                time.sleep(0.001)
            time.sleep(max(0.0, begin + seconds - time.monotonic()))
            while struct.unpack_from("q", given, 0)[0] < minimum:
                assert program.poll() is None
                time.sleep(0.001)
            now = time.monotonic()
            program.send_signal(signal.SIGKILL)
        assert program.returncode == -signal.SIGKILL
        return struct.unpack_from("q", given, 0)[0], (now - begin) * RATE, path


def check(path, given, *, busy=0.0):
    """The file opens and holds what was given but for a quarter of a second; frames that it holds.

    With `busy`, the machine may have kept the program from running for so long, in s.
    """
    seen = open_take(path)
    frames = seen.recording.frames
    assert given - (0.25 + busy) * RATE <= frames <= given
    expected = np.arange(frames)[:, None, None] + np.arange(16).reshape(4, 4) / 16
    np.testing.assert_array_equal(seen.recording.samples, expected)
    assert seen.report == (f"The recording was interrupted: {frames} frames, {frames / RATE:g} s, are kept.",)
    assert repair(path) == open_take(path).report == ()
    assert load(path).frames == frames
    return frames


@pytest.mark.long
@pytest.mark.parametrize("seconds", [0.6])
def test_a_killed_recording_opens_and_lost_at_most_a_quarter_of_a_second(seconds, tmp_path):
    given, _, path = killed_after(seconds, tmp_path, minimum=300)
    check(path, given, busy=0.15)


def begun(path, given):
    """Frames in the file of a program killed in its first quarter of a second, which may not be there yet."""
    assert given <= RATE // 4
    if not path.exists():
        return 0
    try:
        frames = open_take(path).recording.frames
    except BrokenFileError as wrong:
        assert "before its first frame" in str(wrong)
        return 0
    assert frames <= given
    return frames


@pytest.mark.slow
def test_twenty_kills_at_random_moments(tmp_path, capsys):
    """Against what the source had given, and against what it had sampled: that adds the block that it waits for."""
    chance, lost, late = random.Random(20), [], []
    opened = 0
    for number in range(20):
        folder = tmp_path / str(number)
        folder.mkdir()
        given, sampled, path = killed_after(chance.uniform(0.5, 2.5), folder)
        # A machine that keeps the program from running may kill it before its first quarter of a second is over.
        frames = check(path, given) if given > RATE // 4 else begun(path, given)
        lost.append(given - frames)
        late.append(sampled - frames)
        opened += given > RATE // 4
    with capsys.disabled():
        print(
            f"\n20 kills, {opened} after the first quarter of a second, all of those opened: "
            f"lost at most {max(lost)} ms, mean {np.mean(lost):.0f} ms of what was given; "
            f"at most {max(late):.0f} ms, mean {np.mean(late):.0f} ms of what was sampled"
        )
    assert opened >= 16
    assert max(late) > 0, "a kill that never loses anything was no kill"


@pytest.mark.long
def test_a_running_recording_cannot_be_replaced(tmp_path, monkeypatch, capsys):
    path = tmp_path / "n.h5"
    monkeypatch.chdir(tmp_path)
    source = Recording(samples=np.random.default_rng(0).normal(size=(60_000, 4, 4)), rate=RATE)
    save(source, tmp_path / "source.h5")
    record = [*MIDAIR, "record", "replay:source.h5", str(path), "--real-time"]
    with subprocess.Popen(record, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as recorder:
        while not path.exists() or path.stat().st_size < 100_000:
            time.sleep(0.05)
        for words in (["calibrate", "n.h5"], ["repair", "n.h5"], ["gain", "source.h5", "n.h5", "--by", "2", "--force"]):
            assert run(words) == 1
            said = "midair: n.h5: a program is recording into it; wait until it has ended, or end it\n"
            assert capsys.readouterr().err == said
        recorder.terminate()
        said, _ = recorder.communicate(timeout=30)
    assert recorder.returncode == 130
    frames = load(path).frames
    assert f"midair: stopped; {frames} frames are in {path}" in said
    assert open_take(path).report == (), "closed in order"
    np.testing.assert_array_equal(load(path).samples, source.samples[:frames])
    assert sorted(each.name for each in tmp_path.iterdir()) == ["n.h5", "source.h5"]


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="Windows limits the size of no file")
def test_a_limit_of_the_size_of_files_ends_a_recording_in_one_line_that_is_true(tmp_path):
    """As of a shell's `ulimit -f 512`; it was exit status 139 and a file that nothing opened."""
    import resource

    save(Recording(samples=np.random.default_rng(0).normal(size=(6000, 4, 4)), rate=RATE), tmp_path / "source.h5")
    done = subprocess.run(
        [*MIDAIR, "record", "replay:source.h5", "n.h5", "-q"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2**19, 2**19)),
    )
    assert done.returncode == 1
    (line,) = [each for each in done.stderr.splitlines() if each.startswith("midair:")]
    safe = re.fullmatch(r"midair: .*n\.h5: cannot be written: File too large; the (\d+) frames so far are safe", line)
    assert safe is not None, line
    take = open_take(tmp_path / "n.h5")
    assert take.recording.frames == int(safe[1]) > 100
    assert "Traceback" not in done.stderr
