"""Time of a time-resolved playback simulation of one second: `python -m benchmarks.playback`.

996 transducers with individual dynamics, 256 points, 16 kHz. It compares the plain form (one envelope for all
transducers, double precision, all moments of a part at once) with the simulation in both precisions.
"""

from __future__ import annotations

from argparse import ArgumentParser

import numpy as np

from benchmarks.clock import heading, line, load, timed
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

RATE = 16e3


def main() -> None:
    ArgumentParser(prog="python -m benchmarks.playback", description=__doc__.splitlines()[0]).parse_args()
    array = TransducerArray.autd3()
    G = transfer_matrix(ControlGrid(), array)
    steps = np.random.default_rng(0).normal(scale=0.3, size=(1000, array.count))
    drive = Drive(phase=np.cumsum(steps, axis=0), level=np.ones(1000), rate=1000.0, array=array)
    spread = Transducers.varied(array.count, seed=0, gain_spread=0.05, resonance_spread=50.0, quality_spread=0.05)
    chains = {
        "single precision": PlaybackChain(transducers=spread),
        "the same with a silencer": PlaybackChain(transducers=spread, phase_ramp=0.5e-3, level_ramp=0.25e-3),
        "double precision": PlaybackChain(transducers=spread, precision="double"),
    }
    print(load())
    heading("CPU ms")
    line("plain, transducers all alike", timed(lambda: plain(drive, G))[1], digits="0")
    for name, chain in chains.items():
        line(name, timed(lambda chain=chain: simulate(drive, G, chain=chain, rate=RATE))[1], digits="0")


def plain(drive: Drive, G: np.ndarray) -> np.ndarray:
    steps, now, out = round(RATE / drive.rate), None, []
    for first in range(0, drive.frames, 50):
        moving = envelope(drive.q[first : first + 50], drive.rate, steps, TransducerDynamics(), start=now)
        now = moving[-1]
        out.append(radiation_pressure(moving @ G.T, Medium()))
    return np.concatenate(out)


if __name__ == "__main__":
    main()
