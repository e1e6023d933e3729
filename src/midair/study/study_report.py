"""The report of a study: one HTML file with figures, figures in numbers, and words."""

import json
import math
from collections.abc import Mapping
from typing import Any

from midair.figures import Picture, png, render_page
from midair.files import for_json
from midair.study.findings import Finding, Report
from midair.study.study_figures import confusion_figure, f_figure, rating_figure
from midair.version import __version__


def report_page(report: Report, *, title: str, within: tuple[str, ...] = ()) -> str:
    """The report as HTML that needs nothing from outside.

    Parameters
    ----------
    report : Report
        What was found.
    title : str
        Of the study.
    within : tuple of str
        Factors of the ratings, for their figure.
    """
    return render_page(
        "study/report.html.j2",
        title=title,
        simulated=report.simulated,
        pictures=study_pictures(report, within=within),
        findings=[_shown(finding) for finding in report.findings],
        notes=f"midair {__version__}; seed of permutations {report.seed}.",
    )


def report_text(report: Report) -> str:
    """The words of the report for a terminal."""
    return "\n\n".join(f"{finding.title}\n{finding.words}" for finding in report.findings)


def report_json(report: Report) -> str:
    """Words and tables for a program; a number that does not exist is null."""
    content: Mapping[str, Any] = {
        "simulated": report.simulated,
        "seed": report.seed,
        "findings": [
            {
                "title": one.title,
                "words": one.words,
                "table": [] if one.table is None else [for_json(row) for row in one.table.to_dict("records")],
            }
            for one in report.findings
        ],
    }
    return json.dumps(content, indent=2, ensure_ascii=False, default=str)


def study_pictures(report: Report, *, within: tuple[str, ...]) -> list[Picture]:
    """Figures like the paper's 6, 7 and 8, those that the answers allow."""
    found: list[tuple[str, bytes]] = []
    if report.choices:
        figure = confusion_figure(report.choices, simulated=report.simulated)
        found.append(("Answers to “which object?”", png(figure)))
    compared = [one for one in report.choices if one.confusion.labels == report.choices[-1].confusion.labels]
    if compared:
        found.append(("F-measure of each object", png(f_figure(compared, simulated=report.simulated))))
    if report.ratings is not None and 1 <= len(within) <= 3:
        found.append(("Ratings", png(rating_figure(report.ratings, within, simulated=report.simulated))))
    return [Picture(title=title, data=data) for title, data in found]


def _shown(finding: Finding) -> dict[str, Any]:
    table = finding.table
    if table is None:
        return {"title": finding.title, "words": finding.words, "names": [], "rows": []}
    shown = table.loc[:, (table != "").any()]
    rows = [[_cell(value) for value in row] for row in shown.itertuples(index=False, name=None)]
    return {"title": finding.title, "words": finding.words, "names": shown.columns.tolist(), "rows": rows}


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "none" if math.isnan(value) else f"{value:.4g}"
    return str(value)
