import os
import subprocess
import sys
import time

import pytest

from midair.errors import FileError
from midair.files import RecordingWriter, load, repair, save


@pytest.mark.skipif(os.name == "nt", reason="Windows does not let anybody remove a file that is open")
def test_a_recording_whose_name_is_taken_away_is_rescued(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    said = ""
    try:
        with RecordingWriter(path, **options) as writer:
            writer.append(recording.samples)
            (tmp_path / "other").write_bytes(b"of another program")
            os.replace(tmp_path / "other", path)
    except FileError as wrong:
        said = str(wrong)
    rescued = next(tmp_path.glob("live-rescued-*.h5"))
    assert str(rescued) in said
    alike(load(rescued), recording)
    assert path.read_bytes() == b"of another program"


def test_a_running_recording_is_not_replaced(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options) as writer:
        writer.append(recording.samples[:20])
        time.sleep(0.3)
        for replace in (lambda: repair(path), lambda: save(recording, path)):
            with pytest.raises(FileError, match="this program is recording into it"):
                replace()
        writer.append(recording.samples[20:])
    alike(load(path), recording)
    save(recording, path)
    assert sorted(tmp_path.iterdir()) == [path]


READER = """
import sys, h5py
with h5py.File(sys.argv[1], "r", swmr=True) as file:
    for _ in range(2):
        input()
        file["samples"].refresh()
        print(float(file["samples"][:].sum()), len(file["samples"]), flush=True)
"""


def test_any_program_that_knows_hdf5_reads_it_while_it_grows(recording, options, tmp_path):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, interval=1e-9) as writer:
        writer.append(recording.samples[:20])
        words = [sys.executable, "-c", READER, str(path)]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as reader:
            assert reader.stdin is not None
            assert reader.stdout is not None
            for count in (20, 40):
                reader.stdin.write("\n")
                reader.stdin.flush()
                total, frames = reader.stdout.readline().split()
                assert int(frames) == count
                assert float(total) == pytest.approx(recording.samples[:count].sum())
                writer.append(recording.samples[20:]) if count == 20 else None
        assert reader.returncode == 0
