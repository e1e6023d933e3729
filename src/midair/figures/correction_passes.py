"""Error of the waveform after each pass of a correction loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from midair.figures.style import Style, new_figure, plain_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def passes_figure(
    series: Sequence[tuple[str, Sequence[float]]], *, simulated: bool, style: Style | None = None
) -> Figure:
    """Draw the error of the waveform after each pass.

    Parameters
    ----------
    series : sequence of (str, sequence of float)
        Name of each loop, and ||reproduced - original|| / ||original|| of its passes.
    """
    style = style or Style()
    figure = new_figure(5.4, 3.0, simulated=simulated, style=style)
    axis = plain_axes(figure.subplots(), style)
    for (name, errors), colour in zip(series, _colours(style, len(series)), strict=True):
        axis.plot(
            range(1, len(errors) + 1), [100 * error for error in errors], "o-", color=colour, markersize=4, label=name
        )
    axis.set_xlabel("pass", fontsize=9)
    axis.set_ylabel("error of the waveform (%)", fontsize=9)
    axis.set_ylim(0)
    axis.set_xticks(range(1, 1 + max(len(errors) for _, errors in series)))
    axis.legend(fontsize=8, frameon=False)
    return figure


def _colours(style: Style, count: int) -> list[str]:
    palette = (style.reproduced, style.before, style.original, "#009e73", "#cc79a7", "#e69f00", "#0072b2")
    return [palette[number % len(palette)] for number in range(count)]
