"""Fidelity over a whole palm in each mode, and with a quiet palm: `python -m benchmarks.palm`.

For each signal and method: signal to distortion on the cells; the share of the power in the band on a palm of 85 mm
outside the sensor's square; signal to distortion of its pressure and of the displacement of four skin models; the leak
within 20 mm of the square over the target's peak (maximum, typical); the level; and the CPU time of solving one second,
without envelope prediction. Simulated, all stages except the sensor. Parts: `table`, signals in three modes;
`recordings`, twelve recordings in the best and the finest mode, of which four, marked *, were used to choose the finest
mode; `strengths`; `fast`, a guard with the solver of independent frames; `cost`, CPU time of a whole reproduction;
`ears`, sound levels of the exposure check; `floor`, see `benchmarks.palm_floor`. The rows are those of the tables in
docs/decisions/0029-palm.md. Six recordings are from ../shared/data.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.palm_floor import floor
from benchmarks.real_pressure import pressure
from benchmarks.recordings import cloth, pressure_of, rain
from midair.devices import measure_exposure
from midair.files import profile_named
from midair.model import Acoustics, Palm, PressureFrames, Progress
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.pipeline import reproduce, required_lead, resample_pressure
from midair.rig import BudgetPlan, VirtualRig, error_budget
from midair.settings import Settings, best_mode, finest_mode, paper_mode
from midair.solvers import Fast, Guard, automatic_level
from midair.targets import add_lead

ROOM = Acoustics(medium=best_mode().acoustics.medium)
THINGS = ("towel", "sponge", "brush", "noise", "denim")
TUNED = ("towel *", "sponge *", "noise *", "denim *")
UNSEEN = ("linen", "grating of 2 mm", "stick on fabric", "stick on metal", "connect", "confirm", "cloth", "rain")
NOISES = {"cloth": cloth, "rain": rain}
MODES: Mapping[str, Settings] = {
    "paper": paper_mode().but(acoustics=ROOM),
    "best": best_mode(),
    "finest": finest_mode(),
}


def quiet_alone(weight: float) -> Settings:
    """The best mode with a quiet palm instead of its guard."""
    return best_mode().but(guard=None, quiet_palm=weight)


def fast_ways() -> dict[str, Settings]:
    """Guards that reach the palm's edge, with modes to match, and the quiet-palm term."""
    fast = best_mode().but(method=Fast())
    ring = Guard(margin=25e-3, pitch=4.25e-3, ceiling=0.3)
    fine = Fast(tolerance=2e-3)
    return {
        "fast, best's guard": fast,
        "fast, guard 4.25 mm, .1": fast.but(guard=replace(ring, ceiling=0.1)),
        "fast, guard 4.25 mm, 0": fast.but(guard=replace(ring, ceiling=0.0)),
        "the same, weight .1": fast.but(guard=replace(ring, ceiling=0.0, weight=0.1)),
        "guard .1, modes .2 %": fast.but(guard=replace(ring, ceiling=0.1), method=fine),
        "fast, quiet palm .1": fast.but(guard=None, quiet_palm=0.1),
        "the same, modes .2 %": fast.but(guard=None, quiet_palm=0.1, method=fine),
        "quiet palm, guard": fast.but(quiet_palm=0.1),
    }


def original(thing: str, plan: FidelityPlan, settings: Settings) -> PressureFrames:
    """Pressure of a signal for a mode: one of `benchmarks.real_pressure` or of `midair paper --fidelity`."""
    thing = thing.removesuffix(" *")
    if thing in NOISES:
        made = pressure_of(NOISES[thing](plan.duration + 0.2))
        return resample_pressure(made, settings.target.rate).cut(0.1, plan.duration)
    return pressure(thing, settings, plan.duration) or original_of(thing, plan, settings)


@dataclass
class Clock:
    """CPU time of one stage; a callback for the stages of a budget."""

    stage: str
    began: float = 0.0
    spent: float = 0.0

    def __call__(self, name: str) -> Progress:
        self.began = time.process_time()

        def told(_: int, __: int) -> None:
            if name == self.stage:
                self.spent = time.process_time() - self.began

        return told


def row(title: str, thing: str, settings: Settings, plan: FidelityPlan) -> None:
    """Print a row of a table."""
    asked = original(thing, plan, settings)
    settings = at_strength(asked, settings, plan)
    lead, clock = required_lead(settings), Clock("solve")
    made = error_budget(asked, BudgetPlan(settings=settings, rig=plan.rig, lead=lead, palm=Palm.disc()), stage=clock)
    palm, cells, solved = made.palm, made.stage("silencer").so_far.distortion_ratio, made.stage("solver")
    assert palm is not None
    skins = ", ".join(f"{each:.1f}" for each in palm.displacement.values())
    leak = "" if solved.leak is None else f"{solved.leak.peak:.2f}, {solved.leak.typical:.2f}"
    level = settings.solver.level
    level = automatic_level(np.array(plan.strength)) if level == "auto" else level
    spent = clock.spent / (asked.frames / asked.rate + 2 * lead)
    worst = min(palm.displacement.values())
    print(
        f"| {title} | {cells:.1f} | {100 * palm.outside:.1f} % | {palm.pressure:.1f}, {palm.square:.1f} | "
        f"{skins}; {worst:.1f} | {leak} | {level:.2f} | {spent:.1f} |",
        flush=True,
    )


HEAD = "| | | cells | outside | pressure, in square | displacement; worst | leak | level | CPU s/s |"


def table(things: Sequence[str], ways: Mapping[str, Settings], plan: FidelityPlan) -> None:
    """Print signals with several settings."""
    print(f"strength {plan.strength:g}, {plan.duration:g} s\n{HEAD}\n{'| --- ' * 9}|")
    for thing in things:
        for number, (name, settings) in enumerate(ways.items()):
            row(f"{'' if number else thing} | {name}", thing, settings, plan)


def strengths(things: Sequence[str], ways: Mapping[str, Settings], asked: Sequence[float], plan: FidelityPlan) -> None:
    """Print results by strength."""
    print(f"{plan.duration:g} s\n{HEAD}\n{'| --- ' * 9}|")
    for thing in things:
        for strength in asked:
            for number, (name, settings) in enumerate(ways.items()):
                title = f"{'' if number else f'{thing} {strength:g}'} | {name}"
                row(title, thing, settings, replace(plan, strength=strength))


def ears(things: Sequence[str], ways: Mapping[str, Settings], plan: FidelityPlan) -> None:
    """Print levels at the ears and the pressure on the palm from the exposure check, for several settings."""
    profile = profile_named("occupational-110")
    places = [f"{place.name}, dB" for place in profile.places]
    print(f"strength {plan.strength:g}, {plan.duration:g} s\n| | | {' | '.join([*places, 'palm, Pa'])} |")
    print("| --- " * (len(places) + 3) + "|")
    for thing in things:
        for number, (name, settings) in enumerate(ways.items()):
            asked = original(thing, plan, settings)
            settings = at_strength(asked, settings, plan)
            drive = reproduce(add_lead(asked, required_lead(settings)), plan.rig.array, settings).solution.drive
            found = measure_exposure(drive, plan.rig.array, profile)
            cells = " | ".join(f"{each:.1f}" for each in found.peak)
            print(f"| {'' if number else thing} | {name} | {cells} | {found.pressure:.0f} |", flush=True)


def cost(things: Sequence[str], ways: Mapping[str, Settings], plan: FidelityPlan) -> None:
    """Print the CPU time of a whole reproduction, with envelope prediction where a mode has it."""
    for thing in things:
        for name, settings in ways.items():
            asked = original(thing, plan, settings)
            lead = required_lead(settings)
            settings, asked = at_strength(asked, settings, plan), add_lead(asked, lead)
            began = time.process_time()
            reproduce(asked, plan.rig.array, settings)
            print(
                f"{thing}, {name}: {(time.process_time() - began) * asked.rate / asked.frames:.1f} CPU s/s", flush=True
            )


PARTS = ("table", "recordings", "strengths", "fast", "cost", "ears", "floor")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.palm", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=PARTS, nargs="+", default=["table"], help="(default table)")
    parser.add_argument("--things", nargs="+", default=[], help="(default all of the part)")
    parser.add_argument("--ways", nargs="+", help="names of settings (default all)")
    parser.add_argument(
        "--weights", type=float, nargs="*", default=[], help="weights of a quiet palm instead of the guard"
    )
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.05, 0.1, 0.15, 0.2, 0.3, 0.5])
    parser.add_argument(
        "--strength", type=float, default=0.15, help="strength for all parts except strengths and floor (default 0.15)"
    )
    parser.add_argument("--duration", type=float, default=0.3, help="duration of the signals in s (default 0.3)")
    parser.add_argument(
        "--units", type=int, nargs="+", default=[4, 16], help="numbers of units for floor (default 4 16)"
    )
    parser.add_argument("--starts", type=int, default=3, help="random starts for floor (default 3)")
    parser.add_argument("--frames", type=int, default=32, help="frames for floor (default 32)")
    parser.add_argument(
        "--iterations", type=int, default=1000, help="maximum iterations for floor and each weight (default 1000)"
    )
    parser.add_argument("--bounded", action="store_true", help="use amplitudes up to full drive for floor")
    options = parser.parse_args()
    plan = FidelityPlan(strength=options.strength, duration=options.duration, rig=VirtualRig(acoustics=ROOM))
    ways = MODES | {f"quiet palm {weight:g}": quiet_alone(weight) for weight in options.weights}
    fast = fast_ways()
    if options.ways:
        ways, fast = ({name: each[name] for name in options.ways if name in each} for each in (ways, fast))
    both = {name: each for name, each in ways.items() if name != "paper"}
    for part in options.part:
        if part == "table":
            table(options.things or THINGS, ways, plan)
        elif part == "recordings":
            table(options.things or (*TUNED, *UNSEEN), both, plan)
        elif part == "strengths":
            strengths(options.things or THINGS, both, options.strengths, plan)
        elif part == "fast":
            table(options.things or THINGS, fast, plan)
        elif part == "cost":
            cost(options.things or ["towel"], both, plan)
        elif part == "ears":
            ears(options.things or THINGS, ways, plan)
        else:
            floor(
                options.units,
                options.strengths,
                starts_at_random=options.starts,
                frames=options.frames,
                most=options.iterations,
                bounded=options.bounded,
            )


if __name__ == "__main__":
    main()
