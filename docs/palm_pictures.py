"""Figures and film of docs/palm.md: `python docs/palm_pictures.py docs/images`.

A towel in three modes (the paper's solved by glide), as in `midair demo`: pressure in the band on a palm of 85 mm,
displacement of four skin models, and a film of the pressure. Simulated; the colour scale is a square root, so that both
target and leak are visible.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from midair.evaluate import PalmFrames
from midair.figures.style import STYLE, new_figure, png_bytes
from midair.model import Acoustics, Palm
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.physics import SKINS
from midair.pipeline import reproduce, required_lead
from midair.rig import VirtualRig, palm_of_drive
from midair.settings import best_mode, finest_mode, paper_mode
from midair.targets import add_lead
from midair.view import PalmMaps, film_of_palm, write_gif

Array = NDArray[np.float64]
ROOM = Acoustics(medium=best_mode().acoustics.medium)
MODES = {"paper": paper_mode().but(acoustics=ROOM, method="glide"), "best": best_mode(), "finest": finest_mode()}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python docs/palm_pictures.py", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder for palm-pressure.png, palm-skins.png and palm-film.gif")
    parser.add_argument("--duration", type=float, default=0.12, help="duration of the stroke in s (default 0.12)")
    parser.add_argument(
        "--pitch", type=float, default=2.5e-3, help="distance of the palm's points in m (default 0.0025)"
    )
    options = parser.parse_args()
    palm = Palm.disc(pitch=options.pitch)
    shown = {mode: frames_of(mode, options.duration, palm) for mode in MODES}
    options.folder.mkdir(parents=True, exist_ok=True)
    any_skin = {mode: skins["soft, deep"] for mode, skins in shown.items()}
    rows = {"pressure (Pa, rms)": {"wanted": any_skin["best"].wanted} | _each(any_skin, "delivered", 1)}
    (options.folder / "palm-pressure.png").write_bytes(drawn(rows, any_skin["best"]))
    rows = {
        f"{skin} (µm, rms)": {"wanted": 1e6 * shown["best"][skin].wanted_motion}
        | _each({mode: skins[skin] for mode, skins in shown.items()}, "motion", 1e6)
        for skin in SKINS
    }
    (options.folder / "palm-skins.png").write_bytes(drawn(rows, any_skin["best"]))
    film(options.folder / "palm-film.gif", any_skin)


def frames_of(mode: str, duration: float, palm: Palm) -> Mapping[str, PalmFrames]:
    """Pressure and displacement on a palm for a towel in a mode, for each skin."""
    plan = FidelityPlan(duration=duration, rig=VirtualRig(acoustics=ROOM))
    settings = MODES[mode]
    asked = original_of("towel", plan, settings)
    settings = at_strength(asked, settings, plan)
    led = add_lead(asked, required_lead(settings))
    drive = reproduce(led, plan.rig.array, settings).solution.drive
    judged = (required_lead(settings), asked.frames / asked.rate)
    came = palm_of_drive(led, drive, plan.rig, palm)
    return {skin: came.frames(judged=judged, skin=skin) for skin in SKINS}


def _each(shown: Mapping[str, PalmFrames], field: str, scale: float) -> dict[str, Array]:
    return {mode: scale * getattr(frames, field) for mode, frames in shown.items()}


def drawn(rows: Mapping[str, Mapping[str, Array]], frames: PalmFrames) -> bytes:
    """A row of maps for each quantity, as rms over time."""
    figure = new_figure(9.6, 2.3 * len(rows) + 0.8, simulated=True)
    grid = figure.subplots(len(rows), len(next(iter(rows.values()))), sharex=True, sharey=True, squeeze=False)
    for number, (quantity, maps) in enumerate(rows.items()):
        line = grid[number]
        means = {name: np.sqrt((each**2).mean(axis=0)) for name, each in maps.items()}
        roots = PowerNorm(0.5, vmin=0, vmax=max(float(np.nanmax(each)) for each in means.values()))
        for axis, (name, each) in zip(line, means.items(), strict=True):
            y, x = (500 * frames.pitch * count for count in each.shape)
            image = axis.imshow(each, cmap=STYLE.quantity, norm=roots, extent=(-x, x, y, -y))
            half_x, half_y = (1e3 * half for half in frames.square)
            corner, size = (-half_x, -half_y), (2 * half_x, 2 * half_y)
            axis.add_patch(Rectangle(corner, *size, fill=False, edgecolor="white", linestyle="--", linewidth=0.8))
            axis.tick_params(labelsize=8)
            if number == 0:
                axis.set_title(name, fontsize=9, loc="left", color=STYLE.ink)
            if number == len(rows) - 1:
                axis.set_xlabel("x (mm)", fontsize=9)
        line[0].set_ylabel("y (mm)", fontsize=9)
        bar = figure.colorbar(image, ax=list(line), shrink=0.85, pad=0.02)
        bar.set_label(quantity, fontsize=8)
        bar.ax.tick_params(labelsize=8)
    return png_bytes(figure)


def film(path: Path, shown: Mapping[str, PalmFrames], *, frames: int = 30) -> None:
    """Film of the pressure in all modes beside the target, for its strongest thirty milliseconds."""
    best = shown["best"]
    power = np.nansum(best.wanted**2, axis=(1, 2))
    over = np.convolve(power, np.ones(min(frames, len(power))), mode="valid")
    part = slice(int(over.argmax()), int(over.argmax()) + frames)
    maps = {"wanted": best.wanted[part]} | {mode: each.delivered[part] for mode, each in shown.items()}
    made = film_of_palm(
        [PalmMaps(maps=maps, unit="Pa", pitch=best.pitch, square=best.square)], rate=best.rate, side=175
    )
    write_gif(made, path)


if __name__ == "__main__":
    main()
