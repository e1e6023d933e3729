"""Measured transducers instead of nominal ones: `python -m benchmarks.measured_array`.

A virtual array with random transducers from a seed is measured as in `midair calibrate array`. `coverage`: share of the
transducers whose true values are within the reported uncertainties; only this benchmark reads the true values.
`solved`: the signals of the fidelity table in the best mode, solved for the nominal array, for the measured array, and
with envelope prediction for the measured array; played once on the true array, with signal to distortion in dB on the
skin and at the sensor.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.clock import load, timed
from midair.calibration import ArrayPlan
from midair.devices import ExposureChoices
from midair.files import DEFAULT_PROFILE, load_array_calibration, profile_named, save_array_calibration
from midair.model import Acoustics, ArrayCalibration, Medium
from midair.paper.modes_compared import OBJECTS, SIGNALS, FidelityPlan, at_strength, original_of
from midair.pipeline import required_lead
from midair.rig import ArraySession, BudgetPlan, VirtualRig, calibrate_array, error_budget
from midair.rig.names.sensor_names import SPREADS
from midair.settings import best_mode
from midair.solvers import one_blas_thread

ROOM = Acoustics(medium=Medium.at(temperature=22.0, humidity=0.5))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.measured_array", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=("coverage", "solved"), nargs="*", default=["coverage", "solved"])
    parser.add_argument(
        "--seeds", type=int, nargs="*", default=[0, 7, 11], help="seeds of the true values (default 0 7 11)"
    )
    parser.add_argument("--seconds", type=float, default=8.0, help="duration of the codes in s (default 8)")
    parser.add_argument("--spread", choices=SPREADS, default="default", help="differences between the transducers")
    parser.add_argument("--things", nargs="*", default=[*SIGNALS, *OBJECTS])
    parser.add_argument("--keep", type=Path, help="folder for measured arrays, which are then reused")
    options = parser.parse_args()
    print(load())
    with one_blas_thread():
        for seed in options.seeds:
            rig = VirtualRig(seed=seed, acoustics=ROOM, spread=options.spread)
            found, cost = timed(lambda rig=rig: kept(rig, options.seconds, options.keep))
            print(f"seed {seed}: {options.seconds:g} s of codes, {cost / 1e3:.0f} s of CPU", flush=True)
            if "coverage" in options.part:
                coverage(found, rig)
            if "solved" in options.part:
                solved(found, rig, options.things)


def kept(rig: VirtualRig, seconds: float, folder: Path | None) -> ArrayCalibration:
    """Load an earlier measurement if it was kept, otherwise measure."""
    if folder is None:
        return measured(rig, seconds)
    path = folder / f"{rig.spread}-seed{rig.seed}-{seconds:g}.array.h5"
    if not path.exists():
        save_array_calibration(measured(rig, seconds), path)
    return load_array_calibration(path)


def measured(rig: VirtualRig, seconds: float) -> ArrayCalibration:
    """Measure the array with the rig's own sensor."""
    skin = rig.skin()
    array = rig.array_device(skin)
    array.silencer = "off"
    exposure = ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a virtual array")
    with array, rig.sensor(skin) as sensor:
        return calibrate_array(
            array, sensor, ArrayPlan(duration=seconds), session=ArraySession(acoustics=ROOM, exposure=exposure)
        )


def coverage(found: ArrayCalibration, rig: VirtualRig) -> None:
    """Print the share within k = 1 and 2, without the common level and the common phase."""
    true, alive = rig.array_device().chain.transducers, ~found.dead
    told, secret = (each * np.exp(-1j * np.angle(each[alive].sum())) for each in (found.response, true.response))
    level = float(np.median(np.abs(told[alive] / secret[alive])))
    resonance = found.array.frequency + true.pole.imag / (2 * np.pi)
    quality = -np.pi * resonance / true.pole.real
    off = {
        "strength": (np.abs(told) / level - np.abs(secret), found.strength_uncertainty, ""),
        "phase": (np.angle(told / secret), found.phase_uncertainty, " rad"),
        "resonance": (found.resonance - resonance, found.resonance_uncertainty, " Hz"),
        "quality": (found.quality / quality - 1, found.quality_uncertainty, " of it"),
    }
    print(f"  common level: error {100 * (level - 1):.1f} %, uncertainty {200 * found.level_uncertainty:.1f} % (k = 2)")
    for name, (error, uncertainty, unit) in off.items():
        z = np.abs(error / uncertainty)[alive]
        print(
            f"  {name:9} k = 2 is {2 * np.median(uncertainty[alive]):.3g}{unit}: "
            f"{100 * np.mean(z < 2):.1f} % within it, {100 * np.mean(z < 1):.1f} % within k = 1",
            flush=True,
        )


def solved(found: ArrayCalibration, rig: VirtualRig, things: list[str]) -> None:
    """Play each signal once for each array model, without correction."""
    plan = FidelityPlan(rig=rig, best=best_mode().but(acoustics=ROOM))
    for thing in things:
        original = original_of(thing, plan, plan.best)
        settings = at_strength(original, plan.best, plan)
        lead, measured_array = required_lead(settings), found.applied(rig.array)
        ways = {
            "assumed": (settings, None),
            # Without poles there is no envelope prediction.
            "measured": (settings.measured(found), replace(measured_array, pole=np.zeros(0))),
            "foreseen": (settings.measured(found), measured_array),
        }
        results: list[str] = []
        for name, (chosen, array) in ways.items():
            at = BudgetPlan(settings=chosen, rig=rig, lead=lead, measured=array)
            budget, cost = timed(lambda original=original, at=at: error_budget(original, at))
            skin, sensor = (budget.stage(stage).so_far.distortion_ratio for stage in ("silencer", "sensor"))
            out = budget.stage("solver").leak
            leak = 0.0 if out is None else out.peak
            results.append(f"{name}: {skin:.1f}, {sensor:.1f} dB, leak {leak:.2f}, {cost / 1e3:.1f} s")
        print(f"  {thing:9} skin, sensor as {'; '.join(results)}", flush=True)


if __name__ == "__main__":
    main()
