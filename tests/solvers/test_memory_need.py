import subprocess
import sys

import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers import check_memory, memory_of

UNIT = TransducerArray.autd3(columns=1, rows=1)

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
@pytest.mark.long
def test_the_estimate_agrees_with_the_measured_memory(subtests):
    cases = [(2, 32, 4, "glide"), (2, 32, 4, "glide windows"), (2, 16, 800, "fast"), (2, 32, 4, "fast")]
    for units, side, frames, method in [*cases, (4, 32, 1, "fast"), (2, 32, 1, "live")]:
        with subtests.test(units=units, side=side, frames=frames, method=method):
            words = [sys.executable, "-c", GROWTH, str(units), str(side), str(frames), *method.split()]
            seen = int(subprocess.run(words, check=True, capture_output=True, text=True, timeout=300).stdout)
            grid, array = ControlGrid(rows=side, columns=side), TransducerArray.autd3(columns=units, rows=units)
            name, *fit = method.split()
            told = memory_of((grid, frames), array, method=name, **({"fit": fit[0]} if fit else {}))
            # Small arrays reuse memory that libraries freed before.
            assert 0.75 * seen <= told <= 1.6 * seen + 20e6


def test_more_of_anything_takes_more_and_enough_or_unknown_memory_is_accepted():
    for available in (None, 1000):
        check_memory(1000, available, points=1, transducers=1)

    def memory(side=16, units=2, frames=100, **terms):
        grid, array = ControlGrid(rows=side, columns=side), TransducerArray.autd3(columns=units, rows=units)
        return memory_of((grid, frames), array, method="fast", **terms)

    guarded = memory(guard=0.02)
    more = [memory(side=32), memory(units=4), memory(frames=10000), memory(amplitudes="bounded"), guarded]
    assert min(more) > memory()
    assert memory(guard=0.02, robust=2.0) > guarded


def test_memory_of_parts_is_that_of_whole_blocks_of_every_job():
    """A part of a recording by bisection is one block per job, far more frames than with other methods."""
    grid = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
    long = AmplitudeFrames(amplitude=np.zeros((20000, 16)), rate=500.0, grid=grid)
    one, two = (memory_of(long, UNIT, method="glide", parts=True, jobs=jobs) for jobs in (1, 2))
    assert two - one == pytest.approx(1024 * 249 * 64)
    assert one > memory_of(long, UNIT, method="lm", parts=True)
    assert memory_of(long, UNIT, method="glide", jobs=2) > two
    assert memory_of(long, UNIT, method="glide", parts=True, quiet_palm=0.1) > one
