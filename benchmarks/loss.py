"""Print how plays of emulated units survive lost datagrams: `python -m benchmarks.loss`.

A proxy between `midair play` and four emulated units drops datagrams of both directions at random.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from tests.simulators.udp_proxy import UdpProxy

from benchmarks.clock import load
from benchmarks.live_outside import plain, watch_in_time
from midair.files import save_solution
from midair.model import Drive, Solution, TransducerArray


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loss", description=__doc__.splitlines()[0])
    parser.add_argument("--loss", type=float, default=0.001, help="share of lost datagrams (default .001)")
    parser.add_argument("--seconds", type=int, default=60, help="duration of a play in s (default 60)")
    parser.add_argument("--plays", type=int, default=10, help="number of plays (default 10)")
    parser.add_argument("--first", type=int, default=1, help="seed of the first play; the next ones follow (default 1)")
    options = parser.parse_args()
    print(f"real-time priority for the proxy and the units: {watch_in_time()}; {load()}")
    whole = 0
    with tempfile.TemporaryDirectory() as folder:
        drive = Path(folder) / "noise.drive.h5"
        save_solution(noise(1000 * options.seconds), drive)
        for seed in range(options.first, options.first + options.plays):
            whole += play(drive, options.loss, seed, options.seconds)
    print(f"{whole} of {options.plays} plays of {options.seconds} s were played to the end")


def noise(frames: int) -> Solution:
    """Random phases at 1 kHz and a low level; every frame differs from the one before."""
    array = TransducerArray.autd3()
    steps = np.random.default_rng(1).integers(0, 256, (min(frames, 1000), array.count))
    phase = np.tile(steps * (2 * np.pi / 256), (-(-frames // 1000), 1))[:frames]
    drive = Drive(phase=phase, level=np.full(frames, 0.2), rate=1000.0, array=array)
    return Solution(
        drive=drive, error=np.zeros(frames), iterations=np.ones(frames, int), status=("converged",) * frames
    )


def play(drive: Path, loss: float, seed: int, seconds: float) -> bool:
    """Print the outcome of one play; return whether it was played to its end."""
    tap = UdpProxy(4, loss=loss, seed=seed)
    line = [sys.executable, "-m", "midair", "play", str(drive), "--device", f"autd3:{tap.address}"]
    line += ["--silencer", "off", "--override-exposure", "a benchmark"]
    state = {"MIDAIR_STATE": str(drive.parent / "state")}
    try:
        done = subprocess.run(
            line, env=os.environ | state, capture_output=True, text=True, timeout=seconds + 120, preexec_fn=plain
        )
    finally:
        tap.close()
    said = " ".join((done.stdout + done.stderr).split())
    at = max(said.find("midair: a" if done.returncode else "timing "), 0)
    print(f"seed {seed}: status {done.returncode}, {tap.lost} datagrams lost; {load()}: {said[at:][:300]}", flush=True)
    return done.returncode == 0


if __name__ == "__main__":
    main()
