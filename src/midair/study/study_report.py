"""Report of a study as one HTML file with figures, tables and text."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from midair.figures import Picture, png_bytes, render_page
from midair.files import for_json
from midair.study.findings import Finding, Report
from midair.study.study_figures import confusion_figure, f_figure, rating_figure
from midair.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pandas import DataFrame


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


def report_text(report: Report) -> str:
    """Titles and texts of the report for a terminal."""
    return "\n\n".join(f"{finding.title}\n{finding.words}" for finding in report.findings)


def report_json(report: Report) -> str:
    """Texts and tables as JSON; undefined numbers are null."""
    content: Mapping[str, Any] = {
        "simulated": report.simulated,
        "seed": report.seed,
        "findings": [
            {
                "title": one.title,
                "words": one.words,
                "legend": dict(one.legend),
                "table": [] if one.table is None else [for_json(row) for row in one.table.to_dict("records")],
            }
            for one in report.findings
        ],
    }
    return json.dumps(content, indent=2, ensure_ascii=False, default=str)


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureRow:
    """Pictures with a common title and caption; each is at most as wide as a telephone screen."""

    title: str
    caption: str
    panels: tuple[Picture, ...]


def study_pictures(report: Report, *, within: tuple[str, ...]) -> list[PictureRow]:
    """Figures like the paper's 6, 7 and 8, as far as the answers allow."""
    found: list[PictureRow] = []
    if report.choices:
        panels = tuple(
            Picture(title=f"Answers: {one.name}", data=png_bytes(confusion_figure([one], simulated=report.simulated)))
            for one in report.choices
        )
        caption = "Number of answers (columns) to each object (rows); the diagonal contains the correct answers."
        found.append(PictureRow(title="Confusion matrices", caption=caption, panels=panels))
    compared = [one for one in report.choices if one.confusion.labels == report.choices[-1].confusion.labels]
    if compared:
        panel = Picture(title="F-measures", data=png_bytes(f_figure(compared, simulated=report.simulated)))
        limited = any(one.f_limits is not None for one in compared)
        whiskers = "Whiskers: 95 % limits over people." if limited else "Fewer than five people: no limits."
        caption = f"F of each object. {whiskers} Dotted: mean by guessing; single studies vary around it."
        found.append(PictureRow(title="F-measure of each object", caption=caption, panels=(panel,)))
    if report.ratings is not None and 1 <= len(within) <= 3:
        caption = "Mean ratings; whiskers: within-subject 95 % limits, for these people."
        panels = tuple(_rating_panels(report.ratings, within, simulated=report.simulated))
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
    legend = [(name, meaning) for name, meaning in finding.legend if name in names]
    return {"title": finding.title, "words": finding.words, "names": names, "rows": rows, "legend": legend}


def _cell_text(name: str, value: object) -> str:
    if isinstance(value, float):
        if math.isnan(value):
            return "none"
        if name == "p" or name.startswith("p_"):
            return "< .001" if value < 0.001 else f"{value:.3f}"
        return f"{value:.4g}"
    return str(value)
