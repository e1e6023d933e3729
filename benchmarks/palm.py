"""What a whole palm gets in each mode, and with a quiet palm: `python -m benchmarks.palm`.

For each thing and way: signal over distortion on the cells, the share of the power in the band that lies on a palm of
85 mm outside the sensor's square, signal over distortion of its pressure and of the displacement of four model skins,
the leak within 20 mm of the square over the target's peak (largest, typical), the level, and the CPU time that solving
took for a second of what is played. Simulated, all stages but the sensor. Parts: `table`, things in three modes;
`strengths`; `fast`, what a guard does for the solver that takes each frame on its own; `ears`, the exposure gate's
level there; `floor`, see `benchmarks.palm_floor`. Rows are those of the tables of docs/decisions/0029-palm.md.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.palm_floor import floor
from midair.datasets import sample
from midair.devices import measure
from midair.files import profile_named
from midair.model import Acoustics, Calibration, Palm, PressureFrames, Progress
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.pipeline import calibrated_pressure, lead_of, reproduce
from midair.rig import BudgetPlan, VirtualRig, error_budget
from midair.settings import Settings, best_mode, finest_mode, paper_mode
from midair.solvers import Fast, Guard
from midair.solvers.terms import automatic_level
from midair.targets import led_in

ROOM = Acoustics(medium=best_mode().acoustics.medium)
THINGS = ("towel", "sponge", "brush", "noise", "denim")
MODES: Mapping[str, Settings] = {
    "paper": paper_mode().but(acoustics=ROOM),
    "best": best_mode(),
    "finest": finest_mode(),
}


def quiet_alone(weight: float) -> Settings:
    """The best mode with a quiet palm in place of its guard."""
    return best_mode().but(guard=None, quiet_palm=weight)


def fast_ways() -> dict[str, Settings]:
    """A guard that reaches to the palm's edge, with modes to match; and the term."""
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
    """What a mode gets to play: one of `midair paper --fidelity`'s things, or denim slid sixteen times as fast."""
    if thing != "denim":
        return original_of(thing, plan, settings)
    taxels = sample("denim")
    # Its taxels give 36 values a second, which is below the band: 570 a second is a slide at .8 m/s.
    fast = replace(taxels, rate=16 * taxels.rate)
    flat = Calibration.flat(fast.sensor, sensitivity=float(abs(fast.samples).max()) / 30, unit=fast.unit)
    return calibrated_pressure(fast, flat, settings.but(band=(20.0, 250.0))).cut(0.1, plan.duration)


@dataclass
class Clock:
    """CPU time of a stage, as the stages of a budget are told."""

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
    """Print a line of a table."""
    asked = original(thing, plan, settings)
    settings = at_strength(asked, settings, plan)
    lead, clock = lead_of(settings), Clock("solve")
    made = error_budget(asked, BudgetPlan(settings=settings, rig=plan.rig, lead=lead, palm=Palm.disc()), stage=clock)
    palm, cells, solved = made.palm, made.stage("silencer").so_far.distortion_ratio, made.stage("solver")
    assert palm is not None
    skins = ", ".join(f"{each:.1f}" for each in palm.displacement.values())
    leak = "" if solved.leak is None else f"{solved.leak.peak:.2f}, {solved.leak.typical:.2f}"
    level = settings.solver.level
    level = automatic_level(np.array(plan.strength)) if level == "auto" else level
    spent = clock.spent / (asked.frames / asked.rate + 2 * lead)
    print(
        f"| {title} | {cells:.1f} | {100 * palm.outside:.1f} % | {palm.pressure:.1f}, {palm.square:.1f} | {skins} | "
        f"{leak} | {level:.2f} | {spent:.1f} |",
        flush=True,
    )


HEAD = "| | | cells | outside | pressure, in square | displacement | leak | level | CPU s/s |"


def table(things: Sequence[str], ways: Mapping[str, Settings], plan: FidelityPlan) -> None:
    """Things in several ways."""
    print(f"strength {plan.strength:g}, {plan.duration:g} s\n{HEAD}\n{'| --- ' * 9}|")
    for thing in things:
        for number, (name, settings) in enumerate(ways.items()):
            row(f"{'' if number else thing} | {name}", thing, settings, plan)


def strengths(things: Sequence[str], asked: Sequence[float], plan: FidelityPlan) -> None:
    """By strength: the best mode, the finest, and that with less drive and with amplitudes of their own."""
    finest = finest_mode()
    ways = {
        "best": best_mode(),
        "finest": finest,
        "finest, level auto": finest.but(level="auto"),
        "finest, auto, bounded": finest.but(level="auto", amplitudes="bounded"),
    }
    print(f"{plan.duration:g} s\n{HEAD}\n{'| --- ' * 9}|")
    for thing in things:
        for strength in asked:
            for number, (name, settings) in enumerate(ways.items()):
                # What an automatic level leaves as it is needs no second line.
                if settings.solver.level == "auto" and automatic_level(np.array(strength)) == 1:
                    settings = settings.but(level=1.0)
                    if settings.solver.amplitudes == "equal":
                        continue
                row(
                    f"{'' if number else f'{thing} {strength:g}'} | {name}",
                    thing,
                    settings,
                    replace(plan, strength=strength),
                )


def ears(things: Sequence[str], ways: Mapping[str, Settings], plan: FidelityPlan) -> None:
    """Sound at the ears and on the palm by the exposure gate, for the same target in several ways."""
    profile = profile_named("occupational-110")
    places = [f"{place.name}, dB" for place in profile.places]
    print(f"strength {plan.strength:g}, {plan.duration:g} s\n| | | {' | '.join([*places, 'palm, Pa'])} |")
    print("| --- " * (len(places) + 3) + "|")
    for thing in things:
        for number, (name, settings) in enumerate(ways.items()):
            asked = original(thing, plan, settings)
            settings = at_strength(asked, settings, plan)
            drive = reproduce(led_in(asked, lead_of(settings)), plan.rig.array, settings).solution.drive
            found = measure(drive, plan.rig.array, profile)
            said = " | ".join(f"{each:.1f}" for each in found.peak)
            print(f"| {'' if number else thing} | {name} | {said} | {found.pressure:.0f} |", flush=True)


PARTS = ("table", "strengths", "fast", "ears", "floor")


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks.palm", description=__doc__.splitlines()[0])
    ask.add_argument("--part", choices=PARTS, nargs="+", default=["table"], help="(default table)")
    ask.add_argument("--things", nargs="+", default=list(THINGS), help="(default all)")
    ask.add_argument("--ways", nargs="+", help="some of a part's (default all)")
    ask.add_argument("--weights", type=float, nargs="*", default=[], help="of a quiet palm in place of the guard")
    ask.add_argument("--strengths", type=float, nargs="+", default=[0.05, 0.1, 0.15, 0.2, 0.3, 0.5])
    ask.add_argument("--strength", type=float, default=0.15, help="of all parts but strengths and floor (default 0.15)")
    ask.add_argument("--duration", type=float, default=0.3, help="of the signals, in s (default 0.3)")
    ask.add_argument("--units", type=int, nargs="+", default=[4, 16], help="of the floor (default 4 16)")
    ask.add_argument("--starts", type=int, default=3, help="of the floor, at random (default 3)")
    ask.add_argument("--frames", type=int, default=32, help="of the floor (default 32)")
    ask.add_argument(
        "--iterations", type=int, default=1000, help="of the floor at most, for each weight (default 1000)"
    )
    ask.add_argument("--bounded", action="store_true", help="the floor of amplitudes up to full drive")
    said = ask.parse_args()
    plan = FidelityPlan(strength=said.strength, duration=said.duration, rig=VirtualRig(acoustics=ROOM))
    ways = MODES | {f"quiet palm {weight:g}": quiet_alone(weight) for weight in said.weights}
    fast = fast_ways()
    if said.ways:
        ways, fast = ({name: each[name] for name in said.ways if name in each} for each in (ways, fast))
    for part in said.part:
        if part == "table":
            table(said.things, ways, plan)
        elif part == "strengths":
            strengths(said.things, said.strengths, plan)
        elif part == "fast":
            table(said.things, fast, plan)
        elif part == "ears":
            ears(said.things, ways, plan)
        else:
            floor(
                said.units,
                said.strengths,
                starts_at_random=said.starts,
                frames=said.frames,
                most=said.iterations,
                bounded=said.bounded,
            )


if __name__ == "__main__":
    main()
