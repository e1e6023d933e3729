import re
import subprocess
import sys

import numpy as np
import pytest
import soundfile

MOST = 1.5e9
"""Bytes of memory that ten minutes of touch may take."""

RUN = """
import sys
from pathlib import Path
from midair.cli import run

for line in sys.argv[1:]:
    assert run(line.split()) == 0, line
print(Path("/proc/self/status").read_text())
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Ten minutes of 16 channels at 1 kHz, in a sound file and as text."""
    folder, time = tmp_path_factory.mktemp("minutes"), np.arange(600_000) / 1000
    touch = np.sin(2 * np.pi * 100 * time)[:, None] * np.linspace(0.1, 0.9, 16)
    soundfile.write(folder / "long.wav", touch, 1000, subtype="FLOAT")
    table, names = np.column_stack([time, touch]), ",".join(f"c{cell} [Pa]" for cell in range(16))
    np.savetxt(folder / "long.csv", table, "%.6g", ",", header=f"time [s],{names}", comments="")
    return folder


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says VmHWM")
@pytest.mark.parametrize(
    "lines",
    [
        [
            "import long.wav take.h5 --scale 30Pa",
            "solve take.h5 take.drive.h5 --set target.grid={rows=8,columns=8,pitch=0.0073333} "
            "--start-at 300s --duration 50ms",
            "play take.drive.h5",
        ],
        ["import long.csv text.h5"],
    ],
    ids=["sound", "text"],
)
def test_ten_minutes_of_touch_fit_into_memory(lines, folder):
    done = subprocess.run([sys.executable, "-c", RUN, *lines], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert 1024 * int(re.search(r"VmHWM:\s+(\d+)", done.stdout)[1]) < MOST
