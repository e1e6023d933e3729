"""Report of a study as an HTML file with tables, text and figures (paper, Figs. 6 to 8)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pandas import DataFrame

from midair.figures import STYLE, Picture, label_axes, new_figure, plain_axes, png_bytes, render_page
from midair.files import for_json
from midair.study.findings.analysis import Choices, Report
from midair.study.findings.choice_findings import Finding
from midair.study.tables import legend_of
from midair.table import Line, describe
from midair.version import __version__

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def report_page(report: Report, *, title: str, within: tuple[str, ...] = ()) -> str:
    """The report as a self-contained HTML page; `within` names the factors of the ratings, for their figure."""
    return render_page(
        "study/report.html.j2",
        title=title,
        simulated=report.simulated,
        pictures=study_pictures(report, within=within),
        findings=[_table_context(finding) for finding in report.findings],
        notes=f"midair {__version__}; seed of permutations {report.seed}.",
    )


@describe.register
def _(report: Report) -> list[Line]:
    """Titles and texts of the findings, and in JSON their tables; undefined numbers are null."""
    findings = [
        {
            "title": one.title,
            "words": one.words,
            "legend": dict(legend_of(one)),
            "table": [] if one.table is None else [for_json(row) for row in one.table.to_dict("records")],
        }
        for one in report.findings
    ]
    return [*((one.title, one.words) for one in report.findings), {"seed": report.seed, "findings": findings}]


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureRow:
    """Pictures with a common title and caption; each is at most as wide as a telephone screen."""

    title: str
    caption: str
    panels: tuple[Picture, ...]


def study_pictures(report: Report, *, within: tuple[str, ...]) -> list[PictureRow]:
    """Figures like the paper's 6, 7 and 8, as far as the answers allow."""
    found: list[PictureRow] = []
    marked = bool(report.simulated)
    if report.choices:
        panels = tuple(
            Picture(title=f"Answers: {one.name}", data=png_bytes(confusion_figure([one], simulated=marked)))
            for one in report.choices
        )
        caption = "Number of answers (columns) to each object (rows); the diagonal contains the correct answers."
        found.append(PictureRow(title="Confusion matrices", caption=caption, panels=panels))
    compared = [one for one in report.choices if one.confusion.labels == report.choices[-1].confusion.labels]
    if compared:
        panel = Picture(title="F-measures", data=png_bytes(f_figure(compared, simulated=marked)))
        limited = any(one.f_limits is not None for one in compared)
        whiskers = "Whiskers: 95 % limits over people." if limited else "Fewer than five people: no limits."
        caption = f"F of each object. {whiskers} Dotted: mean by guessing; single studies vary around it."
        found.append(PictureRow(title="F-measure of each object", caption=caption, panels=(panel,)))
    if report.ratings is not None and 1 <= len(within) <= 3:
        caption = "Mean ratings; whiskers: within-subject 95 % limits, for these people."
        panels = tuple(_rating_panels(report.ratings, within, simulated=marked))
        found.append(PictureRow(title="Ratings", caption=caption, panels=panels))
    return found


def _rating_panels(ratings: DataFrame, within: tuple[str, ...], *, simulated: bool) -> Iterator[Picture]:
    """One picture for each level of the first of three factors, with a common scale."""
    low, high = (ratings[name].to_numpy(float) for name in ("low", "high"))
    span = (float(low.min()) - 0.1, float(high.max()) + 0.1)
    levels = sorted(set(ratings[within[0]].tolist())) if len(within) == 3 else [""]
    for level in levels:
        rows = ratings.loc[ratings[within[0]] == level] if level else ratings
        title = f"{within[0]}: {level}" if level else "Ratings"
        figure = rating_figure(rows, within[-2:], simulated=simulated, title=title if level else "", span=span)
        yield Picture(title=title, data=png_bytes(figure))


def _table_context(finding: Finding) -> dict[str, Any]:
    table = finding.table
    if table is None:
        return {"title": finding.title, "words": finding.words, "names": [], "rows": [], "legend": []}
    shown = table.loc[:, (table != "").any()]
    names = [str(name) for name in shown.columns]
    rows = [
        [_cell_text(name, value) for name, value in zip(names, row, strict=True)]
        for row in shown.itertuples(index=False, name=None)
    ]
    legend = [(name, meaning) for name, meaning in legend_of(finding) if name in names]
    return {"title": finding.title, "words": finding.words, "names": names, "rows": rows, "legend": legend}


def _cell_text(name: str, value: object) -> str:
    if isinstance(value, float):
        if math.isnan(value):
            return "none"
        if name == "p" or name.startswith("p_"):
            return "< .001" if value < 0.001 else f"{value:.3f}"
        return f"{value:.4g}"
    return str(value)


def confusion_figure(choices: Sequence[Choices], *, simulated: bool) -> Figure:
    """Confusion matrix of each condition (Fig. 6); `simulated` marks the figure."""
    figure = new_figure(2.7 * len(choices) + 0.4, 2.9, simulated=simulated)
    for place, one in enumerate(choices):
        axes = figure.add_subplot(1, len(choices), place + 1)
        counts = one.confusion.counts
        axes.imshow(counts / counts.sum(axis=1, keepdims=True), cmap="Blues", vmin=0, vmax=1)
        for (row, column), count in np.ndenumerate(counts):
            dark = count > counts[row].sum() / 2
            axes.text(column, row, str(count), ha="center", va="center", color="white" if dark else STYLE.ink)
        labels = [str(label) for label in one.confusion.labels]
        _name_ticks(axes, labels)
        axes.set_yticks(range(len(labels)), labels, fontsize=8)
        label_axes(axes, title=one.name, x="answered (number of trials)", y="presented")
    return figure


def f_figure(choices: Sequence[Choices], *, simulated: bool) -> Figure:
    """F-measure of each object with confidence intervals (Fig. 7), for choices of the same objects."""
    figure = new_figure(4.2, 3, simulated=simulated)
    axes = plain_axes(figure.add_subplot(), y="F-measure, 95 % over people")
    width = 0.8 / len(choices)
    colours = [STYLE.before, STYLE.reproduced, "#999999"]
    for place, one in enumerate(choices):
        value = one.confusion.f_measure
        x = np.arange(len(value)) + (place - (len(choices) - 1) / 2) * width
        axes.bar(x, value, width * 0.92, label=one.name, color=colours[place % 3])
        if one.f_limits is not None:
            limits = np.clip([value - one.f_limits.low, one.f_limits.high - value], 0, None)
            # A wide white bar below a black one is visible on every colour.
            axes.errorbar(x, value, limits, fmt="none", ecolor="white", capsize=4, linewidth=3.0, capthick=3.0)
            axes.errorbar(x, value, limits, fmt="none", ecolor="black", capsize=3.5, linewidth=1.2, capthick=1.2)
    labels = [str(label) for label in choices[0].confusion.labels]
    axes.axhline(1 / len(labels), color=STYLE.ink, linewidth=0.8, linestyle=":")
    _name_ticks(axes, labels)
    axes.set_ylim(0, 1.02)
    axes.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def rating_figure(
    ratings: DataFrame, within: Sequence[str], *, simulated: bool, title: str, span: tuple[float, float]
) -> Figure:
    """Mean ratings with confidence intervals (Fig. 8).

    `ratings` has the columns of the factors, mean, low, high. The last of two factors of `within` is the colour, the
    one before it the axis; a single factor is the axis. `span` is the range of the rating axis.
    """
    figure = new_figure(3.9, 3, simulated=simulated)
    axes = plain_axes(figure.add_subplot(), title=title, x=within[0], y="rating, 95 % within people")
    _rating_panel(axes, ratings, within[0], within[1] if len(within) > 1 else "")
    axes.set_ylim(span)
    handles, names = axes.get_legend_handles_labels()
    if names:
        columns = max(1, min(len(names), 3, int(18 * figure.get_figwidth()) // (max(map(len, names)) + 6)))
        figure.legend(handles, names, fontsize=8, frameon=False, ncols=columns, loc="outside lower center")
    return figure


def _name_ticks(axes: Axes, names: Sequence[str]) -> None:
    """Names along the horizontal axis; slanted if they would run into each other."""
    axes.set_xticks(range(len(names)), names, fontsize=8)
    if len(names) * max(map(len, names)) > 24:
        for label in axes.get_xticklabels():
            label.set(rotation=25, ha="right", rotation_mode="anchor")


def _rating_panel(axes: Axes, rows: DataFrame, across: str, colour: str) -> None:
    places = sorted(set(rows[across].tolist()))
    shades = [STYLE.before, STYLE.reproduced, STYLE.original]
    series = sorted(set(rows[colour].tolist())) if colour else [""]
    for i, level in enumerate(series):
        part = rows.loc[rows[colour] == level] if colour else rows
        place = [places.index(name) for name in part[across].tolist()]
        x = np.array(place) + (i - (len(series) - 1) / 2) * 0.2
        error = np.array([part["mean"] - part["low"], part["high"] - part["mean"]])
        axes.errorbar(
            x,
            part["mean"],
            error,
            fmt="o",
            ms=4,
            capsize=2,
            color=shades[i % 3],
            label=f"{colour}: {level}" if colour else None,
        )
    _name_ticks(axes, [str(place) for place in places])
