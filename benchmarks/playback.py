"""Time of a time-resolved playback simulation of one second: `python -m benchmarks.playback`.

996 transducers with individual dynamics, 256 points, 16 kHz. It compares the plain form (one envelope for all
transducers, double precision, all moments of a part at once) with the simulation in both precisions.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from midair.model import ControlGrid, Drive, Medium, TransducerArray
from midair.physics import (
    PlaybackChain,
    TransducerDynamics,
    Transducers,
    envelope,
    radiation_pressure,
    simulate,
    transfer_matrix,
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.playback", description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1.0, help="duration of the drive in s (default 1)")
    parser.add_argument("--rate", type=float, default=16e3, help="simulation rate in Hz (default 16000)")
    options = parser.parse_args()
    array = TransducerArray.autd3()
    G = transfer_matrix(ControlGrid(), array)
    frames = round(1000 * options.seconds)
    steps = np.random.default_rng(0).normal(scale=0.3, size=(frames, array.count))
    drive = Drive(phase=np.cumsum(steps, axis=0), level=np.ones(frames), rate=1000.0, array=array)
    spread = Transducers.varied(array.count, seed=0, gain_spread=0.05, resonance_spread=50.0, quality_spread=0.05)
    chains = {
        "single precision": PlaybackChain(transducers=spread),
        "single precision, silencer's ramps": PlaybackChain(transducers=spread, phase_ramp=0.5e-3, level_ramp=0.25e-3),
        "double precision": PlaybackChain(transducers=spread, precision="double"),
    }
    print(
        f"{options.seconds:g} s at {options.rate:g} Hz, {array.count} transducers, {len(G)} points: clock and CPU time"
    )
    row("plain, transducers all alike", timed(lambda: plain(drive, G, options.rate)))
    for name, chain in chains.items():
        row(name, timed(lambda chain=chain: simulate(drive, G, chain=chain, rate=options.rate)))


def plain(drive: Drive, G: np.ndarray, rate: float) -> np.ndarray:
    steps, now, out = round(rate / drive.rate), None, []
    for first in range(0, drive.frames, 50):
        moving = envelope(drive.q[first : first + 50], drive.rate, steps, TransducerDynamics(), start=now)
        now = moving[-1]
        out.append(radiation_pressure(moving @ G.T, Medium()))
    return np.concatenate(out)


def timed(work: Callable[[], object]) -> tuple[float, float]:
    clock, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processor


def row(name: str, took: tuple[float, float]) -> None:
    print(f"{name:36}{took[0]:8.2f} s{took[1]:8.2f} s")


if __name__ == "__main__":
    main()
