"""Error E of each frame of a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.figures.style import Style, new_figure, plain_axes
from midair.model import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_figure(
    solution: Solution, *, simulated: bool, published: tuple[float, float] = (0.05, 0.15), style: Style | None = None
) -> Figure:
    """Draw E of every frame that plays; the range that the paper reports for static patterns is shaded."""
    style = style or Style()
    figure = new_figure(8.0, 2.6, simulated=simulated, style=style)
    axis = plain_axes(figure.subplots(), style)
    low, high = (100 * value for value in published)
    axis.axhspan(low, high, color=style.band, label=f"paper, static patterns: {low:.0f}–{high:.0f} %")
    plays = np.array([status != "silent" for status in solution.status])
    error = np.where(plays, 100 * solution.error, np.nan)
    axis.plot(solution.drive.time, error, color=style.reproduced, linewidth=0.8, label="this drive")
    axis.set_xlabel("time (s)", fontsize=9)
    axis.set_ylabel("E (%)", fontsize=9)
    # Not scaled to the worst frame: faint frames can have errors of several hundred per cent.
    top = np.nanpercentile(error, 99) if plays.any() else 0
    axis.set_ylim(0, max(20.0, 1.2 * top))
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="upper right")
    return figure
