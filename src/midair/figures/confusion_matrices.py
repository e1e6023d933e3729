"""Confusion matrices side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from midair.figures.style import Style, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfusionPanel:
    """One confusion matrix."""

    title: str
    """Title, with the share of correct answers."""
    names: tuple[str, ...]
    """Names of the classes, for both axes."""
    counts: NDArray[np.int64]
    """Number of answers, shape (true, named)."""


def confusion_figures(matrices: Sequence[ConfusionPanel], *, simulated: bool, style: Style | None = None) -> Figure:
    """Draw matrices in a row: rows are the presented classes, columns the responses; shade is the share of a row."""
    style = style or Style()
    count = len(matrices[0].names)
    side = 0.9 + 0.42 * max(count, 3)
    figure = new_figure(0.4 + side * len(matrices), side + 1.1, simulated=simulated, style=style)
    axes = figure.subplots(1, len(matrices), squeeze=False)[0]
    for axis, matrix in zip(axes, matrices, strict=True):
        share = matrix.counts / np.maximum(matrix.counts.sum(axis=1, keepdims=True), 1)
        axis.imshow(share, cmap="Blues", vmin=0, vmax=1)
        for (row, column), number in np.ndenumerate(matrix.counts):
            ink = "white" if share[row, column] > 0.6 else style.ink
            axis.text(column, row, str(number) if number else "", ha="center", va="center", fontsize=8, color=ink)
        axis.set_title(matrix.title, fontsize=8, loc="left", color=style.ink)
        axis.set_xticks(range(count), matrix.names, rotation=45, ha="right", fontsize=7)
        axis.set_yticks(range(count), matrix.names if axis is axes[0] else [""] * count, fontsize=7)
        axis.set_xlabel("response", fontsize=8)
    axes[0].set_ylabel("presented", fontsize=8)
    return figure
