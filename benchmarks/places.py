"""Re-recording by a displaced sensor: `python -m benchmarks.places`, for solutions by points, windows and cells.

Signals of the fidelity table, .12 s each, in the best mode at strength .15, in the paper's air, on nominal transducers
and on transducers with individual resonance, quality factor and strength. The figures are signal to distortion in 20 to
470 Hz, with a gain for each cell, without the delay and without the leads. Times are CPU times of this process.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.clock import load, timed
from midair.evaluate import advance, find_delay, leak
from midair.evaluate.distortion import decibels, in_band
from midair.model import Acoustics, Drive, PressureFrames
from midair.paper.modes_compared import OBJECTS, SIGNALS, FidelityPlan, at_strength, original_of
from midair.physics import PlaybackChain, Transducers, cell_weights, simulate, transfer_matrix
from midair.pipeline import compensate_pressure, reproduce, required_lead
from midair.settings import Settings, best_mode
from midair.solvers import Glide, one_blas_thread
from midair.targets import add_lead, interpolation_matrix

PLACES = ((0.0, 0.0), (2e-3, 0.0), (2e-3, 2e-3), (4e-3, 0.0), (4e-3, 4e-3), (5.5e-3, 0.0), (5.5e-3, 5.5e-3))
BAND = (20.0, 470.0)
BEFORE = Glide(coarse=256, near=0.6, smooth=6, wide=32, smooth_wide=20, tolerance=5e-3)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.places", description=__doc__.splitlines()[0])
    parser.add_argument("--things", nargs="*", default=[*SIGNALS, *OBJECTS])
    options = parser.parse_args()
    print(load())
    with one_blas_thread():
        places(options.things)


def places(things: list[str]) -> None:
    """Print results for each kind of solution at each position."""
    air, plan = Acoustics(), FidelityPlan()
    best = best_mode().but(acoustics=air)
    modes = {"points": best.but(fit="points", method=BEFORE), "windows": best, "cells": best.but(fit="cells")}
    moves = " ".join(f"({1e3 * x:g},{1e3 * y:g})" for x, y in PLACES)
    print(f"dB on nominal transducers | individual ones, sensor moved by mm {moves}; leak; CPU ms per frame")
    for thing in things:
        for name, settings in modes.items():
            if name == "cells" and thing != "towel":
                continue
            original = original_of(thing, plan, settings)
            alike = at_strength(original, settings, plan)
            asked = add_lead(original, required_lead(alike))
            made, cost = timed(lambda asked=asked, alike=alike: reproduce(asked, plan.rig.array, alike))
            drive = made.solution.drive
            nominal = PlaybackChain(transducers=Transducers.alike(drive.array.count))
            read = [
                [ratio_at(original, asked, drive, alike, plan, chain, place) for place in PLACES]
                for chain in (nominal, plan.rig.array_device().chain)
            ]
            out = leak(drive, made.target.amplitude, alike.target.grid, acoustics=air).peak
            shown = " | ".join(" ".join(f"{each:5.1f}" for each in row) for row in read)
            print(f"{thing:10} {name:8} {shown} ; {out:.2f} ; {cost / drive.frames:.2f}", flush=True)


def ratio_at(
    original: PressureFrames,
    asked: PressureFrames,
    drive: Drive,
    settings: Settings,
    plan: FidelityPlan,
    chain: PlaybackChain,
    place: tuple[float, float],
) -> float:
    """Signal to distortion of a sensor's re-recording at a position, with the best gain of each cell."""
    grid, points, model = settings.target.grid, plan.rig.skin().points, plan.rig.sensor_model
    signed = compensate_pressure(asked, settings).pressure.reshape(asked.frames, -1)
    wanted = signed @ interpolation_matrix(asked.sensor, grid).T @ _on(model, grid, place, "lines").T
    G = transfer_matrix(points, drive.array, acoustics=drive.acoustics)
    read = simulate(drive, G, chain=chain, rate=2 * drive.rate, weights=_on(model, points, place, "waves"))
    # Samples are at the ends of their intervals: every second one, after an initial zero, is at the time of a frame.
    read = np.concatenate([np.zeros((1, read.shape[1])), read])[:-1:2]
    first = (asked.frames - original.frames) // 2
    x, y = (in_band(each, asked.rate, BAND) for each in (wanted, read))
    y = advance(y, find_delay(x, y, asked.rate, longest=2e-3), asked.rate)
    x, y = (each[first : first + original.frames] for each in (x, y))
    power = (x**2).sum(axis=0)
    heard = power >= power.max() / 100
    gain = ((x * y).sum(axis=0) / power)[heard]
    missed = y[:, heard] - gain * x[:, heard]
    return decibels(float((gain**2 * power[heard]).sum()), float((missed**2).sum()))


def _on(model: object, grid: object, place: tuple[float, float], between: str) -> np.ndarray:
    return cell_weights(model, replace(grid, centre=(0.0, 0.0)), centre=place, between=between)


if __name__ == "__main__":
    main()
