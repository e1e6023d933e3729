"""Error of drives at other air temperatures: `python -m benchmarks.air`.

A part of a virtual towel stroke, at one strength, in both modes and at three heights, is solved for a laboratory at 22
degrees Celsius, for the same with a temperature range of two degrees (`--robust 2C`), and for the paper's 340 m/s. E is
the mean over the frames, in %, when it is played in air of other temperatures (`midair.evaluate.error_at_temperature`).
The table `corrected`: the drive for 22 degrees as it is, with its phases corrected (`midair play --correct-air`), and
solved again for each temperature. The table `ratio`: signal to distortion of the touched cells on the skin in dB, for
.12 s, with and without `--robust 2C`, which windows do not support. The tables are printed as the Markdown of
docs/air.md.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import midair
from midair.correct import correct_air
from midair.evaluate import error_at_temperature
from midair.figures import png_bytes
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import Acoustics, Medium, TransducerArray
from midair.paper import FidelityPlan
from midair.paper.modes_compared import at_strength, original_of
from midair.physics import focus_amplitude
from midair.pipeline import Reproduction, calibrated_pressure, reproduce, required_lead, target_amplitude
from midair.rig import BudgetPlan, VirtualRig, error_budget
from midair.settings import MODES, Settings

ARRAY = TransducerArray.autd3()
ROOM = Medium.at(temperature=22.0, humidity=0.5)
SOLVED: Mapping[str, tuple[Medium, float]] = {
    "22 °C": (ROOM, 0.0),
    "22 °C, robust 2C": (ROOM, 2.0),
    "340 m/s": (Medium(), 0.0),
}
COLUMNS = (14, 18, 20, 21, 22, 23, 24, 26, 30)
TABLES = ("effect", "corrected", "ratio")
CORRECTED = (14, 18, 20, 22, 24, 26, 30)
RATIO = (18, 20, 22, 24, 26)
SMOOTH = np.arange(14.0, 30.1, 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.air", description=__doc__.splitlines()[0])
    parser.add_argument("--figure", type=Path, help="PNG file for the curves")
    parser.add_argument(
        "--heights", type=float, nargs="+", default=[0.15, 0.2, 0.25], help="heights in m (default .15 .2 .25)"
    )
    parser.add_argument("--duration", type=float, default=0.02, help="duration of the part in s (default .02)")
    parser.add_argument("--strength", type=float, default=0.1, help="target peak over a single focus (default .1)")
    parser.add_argument("--modes", nargs="+", choices=("paper", "best"), default=["paper", "best"])
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=["effect", "corrected"])
    options = parser.parse_args()
    stroke = midair.record("virtual:towel", 1.0)
    if options.tables != ["ratio"]:
        print(f"towel, {options.duration:g} s, strength {options.strength:g}; mean E in %")
    if "effect" in options.tables:
        curves = print_effect(stroke, options)
        if options.figure:
            options.figure.write_bytes(drawn(curves, options.heights))
    if "corrected" in options.tables:
        print_corrected(stroke, options)
    if "ratio" in options.tables:
        print_ratio(options)


def print_effect(
    stroke: midair.files.OpenedTake, options: argparse.Namespace
) -> dict[tuple[str, float, str], np.ndarray]:
    """E of drives at other temperatures than they were solved for; returns the curves of the figure."""
    print_head(("mode, height", "solved for"), COLUMNS, "CPU ms a frame")
    curves: dict[tuple[str, float, str], np.ndarray] = {}
    for mode in options.modes:
        for height in options.heights:
            for name, (medium, robust) in SOLVED.items():
                if mode == "best" and robust:
                    continue
                settings = settings_at(mode, height).but(robust=robust, acoustics=Acoustics(medium=medium))
                made, cost = solved(stroke, settings, options.duration, options.strength)
                row = " | ".join(f"{100 * error(made, each):.1f}" for each in COLUMNS)
                print(f"| {mode}, {1e3 * height:.0f} mm | {name} | {row} | {cost:.0f} |", flush=True)
                curves[mode, height, name] = np.array([error(made, each) for each in SMOOTH])
    return curves


def print_head(names: tuple[str, ...], temperatures: tuple[int, ...], *more: str) -> None:
    """Head of a Markdown table."""
    print("| " + " | ".join((*names, *(f"{each} °C" for each in temperatures), *more)) + " |")
    print("|" + "---|" * len(names) + "--:|" * (len(temperatures) + len(more)), flush=True)


def settings_at(mode: str, height: float) -> Settings:
    """Settings of a mode at a height in m."""
    settings = MODES[mode]()
    return settings.but(grid=type(settings.target.grid)(height=height))


def solved(
    take: midair.files.OpenedTake, settings: Settings, duration: float, strength: float
) -> tuple[Reproduction, float]:
    """Reproduction at a strength, and its CPU time in ms per frame."""
    pressure = calibrated_pressure(take.recording, take.calibration, settings).cut(0.45, duration)
    focus = focus_amplitude(settings.target.grid, ARRAY, acoustics=settings.acoustics)
    now = float(target_amplitude(pressure, settings).amplitude.max() / focus)
    start = time.process_time()
    made = reproduce(pressure, ARRAY, settings.but(gain=(strength / now) ** 2))
    return made, 1e3 * (time.process_time() - start) / pressure.frames


def print_corrected(take: midair.files.OpenedTake, options: argparse.Namespace) -> None:
    """E of the drive for 22 degrees Celsius as it is, corrected, and solved again."""
    print_head(("mode, height",), CORRECTED)
    for mode in options.modes:
        for height in options.heights:
            settings = settings_at(mode, height)
            own, _ = solved(take, settings.but(acoustics=Acoustics(medium=ROOM)), options.duration, options.strength)
            centre = own.target.grid.position.mean(axis=0)
            cells: list[str] = []
            for temperature in CORRECTED:
                room = Medium.at(temperature=temperature, humidity=0.5)
                again, _ = solved(
                    take, settings.but(acoustics=Acoustics(medium=room)), options.duration, options.strength
                )
                # With the air it was solved for, to which its target belongs.
                drive = replace(correct_air(own.solution.drive, room, centre), acoustics=own.solution.drive.acoustics)
                after = float(error_at_temperature(drive, own.target, room).mean())
                row = (error(own, temperature), after, error(again, temperature))
                cells.append(" / ".join(f"{100 * each:.1f}" for each in row))
            print(f"| {mode}, {1e3 * height:.0f} mm | " + " | ".join(cells) + " |", flush=True)


def print_ratio(options: argparse.Namespace) -> None:
    """Signal to distortion on the skin in air of other temperatures, with and without a range of temperatures."""
    print("towel, 0.12 s, strength 0.15; signal to distortion in dB")
    print_head(("mode", "solved for"), RATIO)
    best = MODES["best"]()
    ways = {"paper": MODES["paper"]().but(method="glide"), "best": best, "best, --fit points": best.but(fit="points")}
    for name, settings in ways.items():
        if name.split(",")[0] not in options.modes:
            continue
        for robust in (0.0, 2.0) if settings.solver.fit == "points" else (0.0,):
            chosen, cells = settings.but(robust=robust, acoustics=Acoustics(medium=ROOM)), []
            for temperature in RATIO:
                air = Acoustics(medium=Medium.at(temperature=temperature, humidity=0.5))
                plan = FidelityPlan(strength=0.15, rig=VirtualRig(acoustics=air))
                original = original_of("towel", plan, chosen)
                alike = at_strength(original, chosen, plan)
                made = error_budget(original, BudgetPlan(settings=alike, rig=plan.rig, lead=required_lead(alike)))
                cells.append(f"{made.stage('silencer').so_far.distortion_ratio:.1f}")
            print(f"| {name} | 22 °C{', robust 2C' * bool(robust)} | {' | '.join(cells)} |", flush=True)


def error(made: Reproduction, temperature: float) -> float:
    """Mean E in air of this temperature."""
    room = Medium.at(temperature=temperature, humidity=0.5)
    return float(error_at_temperature(made.solution.drive, made.target, room).mean())


def drawn(curves: Mapping[tuple[str, float, str], np.ndarray], heights: list[float]) -> bytes:
    """Curves as a PNG, with a column per mode and a row per height."""
    modes = list(dict.fromkeys(mode for mode, _, _ in curves))
    figure = new_figure(7.0, 6.4, simulated=True)
    grid = figure.subplots(len(heights), len(modes), sharex=True, sharey=True, squeeze=False)
    colours = dict(zip(SOLVED, (STYLE.before, STYLE.reproduced, STYLE.original), strict=True))
    for (mode, height, name), curve in curves.items():
        axes = plain_axes(grid[heights.index(height), modes.index(mode)])
        axes.plot(SMOOTH, 100 * curve, color=colours[name], linewidth=1.2, label=f"solved for {name}")
        axes.set_title(f"{mode} mode, {1e3 * height:.0f} mm", fontsize=9, loc="left")
        axes.set_ylim(0, 60)
        axes.set_xlim(SMOOTH[0], SMOOTH[-1])
        axes.set_xticks(range(14, 31, 4))
    for axes in grid[:, 0]:
        axes.set_ylabel("mean E (%)", fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("temperature of the room (°C)", fontsize=8)
    # The first column has all curves, the last one room for their names.
    grid[0, -1].legend(*grid[0, 0].get_legend_handles_labels(), fontsize=8, frameon=False, loc="upper left")
    return png_bytes(figure)


if __name__ == "__main__":
    main()
