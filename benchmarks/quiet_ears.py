"""Cost and benefit of the quiet-ears term: `python -m benchmarks.quiet_ears`.

E at the control points, the loudest sound at either ear from the exposure check, and the radiation pressure on the palm
after the drive is attenuated to 110 dB at the ears. One static pattern (a ring of cells) and a towel stroke, each at
the level that its loudest frame needs. `--modes`: the best mode with automatic level, with bounded amplitudes and with
free ones instead: sound at the ears, signal to distortion on the skin (touched cells) and CPU time of the solution.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.clock import load, timed
from benchmarks.palm import THINGS, original
from benchmarks.targets import GRID, TEN, binary, problem_of, towel
from midair.devices import measure_exposure
from midair.files import profile_named
from midair.model import Acoustics, AmplitudeFrames, Medium, TransducerArray
from midair.paper.modes_compared import FidelityPlan, at_strength
from midair.physics import focus_amplitude
from midair.pipeline import reproduce, required_lead
from midair.rig import BudgetPlan, error_budget
from midair.settings import best_mode
from midair.solvers import one_blas_thread, solve
from midair.targets import add_lead

ARRAY, ROOM = TransducerArray.autd3(), Medium.at()

WAYS: dict[str, dict[str, object]] = {
    "best": {},
    "auto level": {"level": "auto"},
    "bounded": {"amplitudes": "bounded"},
    "auto, bounded": {"level": "auto", "amplitudes": "bounded"},
    "free": {"method": "free"},
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.quiet_ears", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--strengths", type=float, nargs="+", default=[0.05, 0.1, 0.2, 0.3], help="strengths of the targets"
    )
    parser.add_argument("--weights", type=float, nargs="+", default=[0, 3, 30, 300], help="weights of the term")
    parser.add_argument("--frames", type=int, default=100, help="frames of the towel stroke (default 100)")
    parser.add_argument("--modes", nargs="*", choices=THINGS, help="compare ways of the best mode on these")
    parser.add_argument("--ways", nargs="*", choices=WAYS, default=[*WAYS], help="only these ways")
    options = parser.parse_args()
    if options.modes is not None:
        with one_blas_thread():
            modes(options.modes or THINGS, options.strengths, options.ways)
        return
    focus = focus_amplitude(GRID, ARRAY)
    profile = profile_named("occupational-110")
    for strength in options.strengths:
        for name, amplitude in (
            ("pattern", problem_of(binary([TEN[3]]), strength).amplitude),
            ("towel", towel(options.frames, strength).amplitude),
        ):
            target = AmplitudeFrames(amplitude=focus * amplitude, rate=1000.0, grid=GRID)
            first = None
            for weight in options.weights:
                solution = solve(target, ARRAY, method="fast", level="auto", quiet_ears=weight, acoustics=Acoustics())
                found = measure_exposure(solution.drive, ARRAY, profile)
                ears = max(found.peak[0], found.peak[1])
                first = ears if first is None else first
                left = found.pressure * 10 ** (-max(found.excess, 0) / 10)
                error = 100 * solution.error[solution.plays].mean()
                print(
                    f"{name:8} strength {strength:.2f} weight {weight:6g}: E {error:5.1f} %, "
                    f"ears {ears:6.1f} dB ({ears - first:+5.1f}), palm {found.pressure:6.1f} Pa, "
                    f"at 110 dB {left:.2g} Pa",
                    flush=True,
                )


def modes(things: Sequence[str], strengths: list[float], ways: Sequence[str]) -> None:
    """Print a row for each signal, strength and way."""
    print(load())
    for strength in strengths:
        plan = FidelityPlan(strength=strength)
        for thing in things:
            for name in ways:
                settings = best_mode().but(**WAYS[name])
                pressure = original(thing, plan, settings)
                settings = at_strength(pressure, settings, plan)
                asked, rig = add_lead(pressure, required_lead(settings)), replace(plan.rig, cells=pressure.sensor)
                made, cost = timed(lambda s=settings, a=asked, r=rig: reproduce(a, r.array, s))
                found = measure_exposure(made.solution.drive, ARRAY, profile_named("occupational-110"), room=ROOM)
                stages = error_budget(pressure, BudgetPlan(settings=settings, rig=rig, lead=required_lead(settings)))
                skin, leak = stages.stage("silencer").so_far, stages.stage("solver").leak
                print(
                    f"strength {strength:g} {thing:7} {name:14} ears {found.peak[:2].max():6.1f} dB, bystander "
                    f"{found.peak[2]:6.1f} dB, touched cells {skin.distortion_ratio:5.1f} dB, "
                    f"leak {100 * leak.peak:3.0f} %, {cost / made.target.frames:5.2f} ms a frame",
                    flush=True,
                )


if __name__ == "__main__":
    main()
