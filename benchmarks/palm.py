"""What a whole palm gets in each mode, and with a quiet palm: `python -m benchmarks.palm`.

For each thing and way: signal over distortion on the cells, the share of the power in the band that lies on a palm of
85 mm outside the sensor's square, signal over distortion of its pressure and of the displacement of four model skins,
the level, and the CPU time that solving took for a second of recording. Simulated, all stages but the sensor.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

from midair.datasets import sample
from midair.flow import felt, lead_of, reproduce
from midair.model import Acoustics, Calibration, Palm, PressureFrames
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.rig import BudgetPlan, VirtualRig, error_budget
from midair.settings import Settings, best_mode, paper_mode
from midair.targets import led_in

ROOM = Acoustics(medium=best_mode().acoustics.medium)


def ways(weights: list[float]) -> dict[str, Settings]:
    """The modes, and the best one with a quiet palm in place of its guard."""
    best = best_mode().but(quiet_palm=0.0)
    named = {f"quiet palm {weight:g}": best.but(guard=None, quiet_palm=weight) for weight in weights}
    return {"paper": paper_mode().but(acoustics=ROOM), "best": best} | named


def original(thing: str, plan: FidelityPlan, settings: Settings) -> PressureFrames:
    """What a mode gets to play: one of `midair paper --fidelity`'s things, or denim slid sixteen times as fast."""
    if thing != "denim":
        return original_of(thing, plan, settings)
    taxels = sample("denim")
    # Its taxels give 36 values a second, which is below the band: 570 a second is a slide at .8 m/s.
    fast = replace(taxels, rate=16 * taxels.rate)
    flat = Calibration.flat(fast.sensor, sensitivity=float(abs(fast.samples).max()) / 30, unit=fast.unit)
    return felt(fast, flat, settings.but(band=(20.0, 250.0))).cut(0.1, plan.duration)


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks.palm", description=__doc__.splitlines()[0])
    ask.add_argument("--things", nargs="+", default=["towel", "sponge", "brush", "noise", "denim"])
    ask.add_argument("--ways", nargs="+", help="some of paper, best, quiet palm 0.1 (default all)")
    ask.add_argument("--weights", type=float, nargs="+", default=[0.1], help="of the quiet palm (default 0.1)")
    ask.add_argument("--strengths", type=float, nargs="+", default=[0.15], help="of the targets (default 0.15)")
    ask.add_argument("--levels", nargs="+", default=["1"], help="drive of the transducers, 0 to 1 or auto (default 1)")
    ask.add_argument("--amplitudes", default="equal", choices=["equal", "bounded"])
    ask.add_argument("--duration", type=float, default=0.12, help="in s (default 0.12)")
    said = ask.parse_args()
    rig = VirtualRig(acoustics=ROOM)
    for thing, strength, level in ((t, s, v) for t in said.things for s in said.strengths for v in said.levels):
        plan = FidelityPlan(strength=strength, duration=said.duration, rig=rig)
        for name, settings in ways(said.weights).items():
            if said.ways and name not in said.ways:
                continue
            played = settings.but(level=level if level == "auto" else float(level), amplitudes=said.amplitudes)
            print_line(f"{thing:7} {name:14} strength {strength:g}, level {level}", thing, played, plan)


def print_line(title: str, thing: str, settings: Settings, plan: FidelityPlan) -> None:
    """Solve once for the clock, and once within the budget."""
    asked = original(thing, plan, settings)
    settings = at_strength(asked, settings, plan)
    lead = lead_of(settings)
    before, whole = time.process_time(), led_in(asked, lead)
    reproduce(whole, plan.rig.array, settings)
    spent = (time.process_time() - before) / (whole.frames / whole.rate)
    made = error_budget(asked, BudgetPlan(settings=settings, rig=plan.rig, lead=lead, palm=Palm.disc()))
    palm, cells = made.palm, made.stage("silencer").so_far.distortion_ratio
    skins = " ".join(f"{each:5.1f}" for each in palm.displacement.values())
    print(
        f"{title}: cells {cells:5.1f} dB, outside {100 * palm.outside:5.1f} %, pressure {palm.pressure:5.1f} dB, "
        f"square {palm.square:5.1f} dB, skins {skins} dB, {spent:.2f} s/s",
        flush=True,
    )


if __name__ == "__main__":
    main()
