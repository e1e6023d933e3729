import subprocess
import sys

import pytest

from midair.errors import InputError
from midair.solvers import check_memory, memory_needed

GROWTH = r"""
import re, sys
from pathlib import Path
import numpy as np
from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers import solve

units, side, frames, method, *fit = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), *sys.argv[4:]
more = {"fit": fit[0]} if fit else {}

def solved(units, side, frames):
    grid = ControlGrid(rows=side, columns=side)
    amplitude = np.random.default_rng(0).uniform(100, 1500, (frames, grid.count))
    array = TransducerArray.autd3(columns=units, rows=units)
    solve(AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=grid), array, method=method, iterations=None, **more)
    # Not ru_maxrss, which starts at the peak of the parent process.
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])

# A very small problem first, so that libraries allocate their one-time memory.
before = solved(2 if fit else 1, 8 if fit else 2, 1)
print(solved(units, side, frames) - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says VmHWM")
@pytest.mark.parametrize(
    ("units", "side", "frames", "method"),
    [
        (2, 32, 4, "glide"),
        (2, 32, 4, "glide windows"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [(2, 16, 800, "fast"), (2, 32, 4, "fast"), (4, 32, 1, "fast"), (2, 32, 1, "live")]
        ),
    ],
)
@pytest.mark.long
def test_the_estimate_agrees_with_the_measured_memory(units, side, frames, method):
    words = [sys.executable, "-c", GROWTH, str(units), str(side), str(frames), *method.split()]
    seen = int(subprocess.run(words, check=True, capture_output=True, text=True, timeout=300).stdout)
    told = memory_needed(side**2, 249 * units**2, frames, method=method.split()[0], folded="windows" in method)
    # Small arrays reuse memory that libraries freed before.
    assert 0.75 * seen <= told <= 1.6 * seen + 20e6


def test_too_little_memory_is_refused_in_one_line():
    with pytest.raises(
        InputError, match=r"0\.05 GB of free memory, got 15936 transducers x 4096 points, .* 0\.09 GB; use"
    ):
        check_memory(90_000_000, 50_000_000, points=4096, transducers=15936)


@pytest.mark.parametrize("available", [None, 1000])
def test_enough_or_unknown_memory_is_accepted(available):
    check_memory(1000, available, points=1, transducers=1)


def test_more_of_anything_takes_more():
    least = memory_needed(256, 996, 100, method="fast")
    more = [
        memory_needed(1024, 996, 100, method="fast"),
        memory_needed(256, 3984, 100, method="fast"),
        memory_needed(256, 996, 10000, method="fast"),
        memory_needed(256, 996, 100, method="fast", guard=420),
        memory_needed(256, 996, 100, method="fast", guard=420, airs=3),
    ]
    assert min(more) > least
    assert more[4] > more[3]
