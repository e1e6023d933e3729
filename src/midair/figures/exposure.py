"""Sound pressure level of each frame of a drive at ears and palm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.figures.style import Style, new_figure, plain_axes
from midair.physics import Exposure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def exposure_figure(exposure: Exposure, *, simulated: bool, style: Style | None = None) -> Figure:
    """Draw the level of every frame at every place, each with its limit as a dashed line of the same colour."""
    style = style or Style()
    figure = new_figure(8.0, 3.2, simulated=simulated, style=style)
    axis = plain_axes(figure.subplots(), style)
    time = np.arange(len(exposure.level)) / exposure.rate
    colours = (style.original, style.reproduced, style.before, "#009e73", "#cc79a7", "#e69f00")
    for number, place in enumerate(exposure.profile.places):
        colour = colours[number % len(colours)]
        # Silent frames are left out: their level at the floor of the scale would stretch the axis.
        heard = exposure.level[:, number] > 0
        label = f"{place.name}, limit {place.limit:g} dB{'' if place.enforced else ' (advice)'}"
        axis.plot(time, np.where(heard, exposure.level[:, number], np.nan), color=colour, linewidth=0.8, label=label)
        axis.axhline(place.limit, color=colour, linewidth=0.8, linestyle="--")
    axis.set_xlabel("time (s)", fontsize=9)
    axis.set_ylabel("level (dB re 20 µPa rms)", fontsize=9)
    axis.set_title(exposure.verdict(), fontsize=8, loc="left")
    axis.margins(x=0)
    axis.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure
