"""A Jupyter notebook that repeats the analysis of the report step by step."""

import json
from collections.abc import Mapping
from typing import Any

from midair.study.findings import StudyData
from midair.version import __version__

BEGIN = """\
from pathlib import Path

import numpy as np
from IPython.display import Markdown, display

import midair.study as study
"""

WHOLE = """\
report = study.analyse(data, seed={seed}, draws={draws})
for finding in report.findings:
    display(Markdown(f"### {{finding.title}}\\n{{finding.words}}"))
    if finding.table is not None:
        display(finding.table)
"""

FIGURES = """\
from IPython.display import Image

for row in study.study_pictures(report, within=data.within):
    display(Markdown(f"### {row.title}\\n{row.caption}"))
    for panel in row.panels:
        display(Image(panel.data))
"""

CHOICES = """\
rng = np.random.default_rng({seed})
for name, rows in data.choices.groupby("condition", sort=False):
    labels = sorted(set(rows["presented"]))
    # Answers that name an object that was never presented; the plan states how they count.
    foils = sorted(set(rows["answered"]) - set(labels))
    if data.foils == "leave out":
        rows, foils = rows[rows["answered"].isin(labels)], []
    confusion = study.confusion_matrix(
        rows["presented"], rows["answered"], participant=rows["participant"], labels=labels, foils=foils
    )
    chance = study.chance_macro_f(confusion, rng=rng, draws={draws})
    kappa = study.cohen_kappa(confusion.counts)
    print(f"{{name}}: macro F {{confusion.macro_f:.3f}}, kappa {{kappa:.2f}}, p = {{chance.p:.4f}}")
    display(study.scores(confusion))
"""

MIXED = """\
rows = data.choices.assign(correct=data.choices["presented"] == data.choices["answered"])
within = ["presented", "condition"] if rows["condition"].nunique() > 1 else ["presented"]
mixed = study.logistic_mixed(rows, correct="correct", participant="participant", within=within)
mixed.assign(p_Holm=study.holm(mixed["p"]))
"""

RATINGS = """\
# Participants with an answer in every cell; the plan states how the others are treated.
cells = data.ratings.groupby("participant")[list(data.within)].apply(lambda one: len(one.drop_duplicates()))
whole = cells.index[cells == len(data.ratings[list(data.within)].drop_duplicates())]
ratings = data.ratings[data.ratings["participant"].isin(whole)]
anova = study.rm_anova(
    ratings, value="rating", participant="participant", within=data.within, between=data.between
)
anova.assign(p_Holm=study.holm(anova["p_GG"]))
"""

PAIRS = """\
# Add interactions to compare their cells, such as effects=["surface:object"].
study.pairwise(ratings, value="rating", participant="participant", within=data.within, between=data.between)
"""

CUMULATIVE = """\
study.cumulative_mixed(data.ratings, value="rating", participant="participant", within=data.within)
"""

RANKS = """\
study.ordinal_check(
    ratings, value="rating", participant="participant", within=data.within, rng=np.random.default_rng({seed})
)
"""

STRENGTHS = """\
counts = data.strengths.groupby("level")["correct"].agg(["sum", "size"])
study.fit_psychometric(
    counts.index.to_numpy(float), counts["sum"].to_numpy(), counts["size"].to_numpy(),
    guess=float(data.strengths["guess"].iloc[0]), lapse_most=float(data.strengths["lapse_most"].iloc[0]),
    shape="weibull", rng=np.random.default_rng({seed}),
)
"""

THRESHOLDS = """\
data.thresholds
"""


def load_study(folder: str) -> str:
    """Python code that loads the answers of a study; `folder` is relative to the notebook."""
    return f"""\
folder = study.StudyFolder(Path({folder!r}))
answers = study.answers_table(folder.plan(), folder.sessions())
data = study.data_of_study(folder)
answers
"""


def load_table(path: str, columns: Mapping[str, Any], *, bids: bool = False) -> str:
    """Python code that loads answers from a table or a BIDS folder; `columns` are the options of `data_of_columns`."""
    named = "".join(f"    {name}={value!r},\n" for name, value in columns.items())
    reader = "read_bids" if bids else "read_csv"
    return f"answers = study.{reader}(Path({path!r}))\ndata = study.data_of_columns(\n    answers,\n{named})\nanswers\n"


def analysis_notebook(data: StudyData, loading: str, *, title: str, seed: int = 0, draws: int = 10_000) -> str:
    """The analysis as a Jupyter notebook (JSON of nbformat 4.5); `data` decides which steps it has.

    `loading` is Python code that creates `data`, run in the folder of the notebook with `Path` and `study` defined;
    `seed` and `draws` as for `analyse`.
    """
    said = "**SIMULATED: no person was asked.** " if data.simulated else ""
    head = f"# {title}\n\n{said}The whole analysis step by step, created by midair {__version__}."
    cells = [_cell(head), _cell(BEGIN, code=True), _cell("## Answers"), _cell(loading, code=True)]
    steps: list[tuple[str, str]] = [("Complete report", WHOLE.format(seed=seed, draws=draws))]
    if data.choices is not None:
        steps.append(("Identification by condition", CHOICES.format(seed=seed, draws=draws)))
        steps.append(("Mixed model of correct answers", MIXED))
    if data.ratings is not None:
        steps.append(("Ratings: analysis of variance", RATINGS))
        steps.append(("Ratings: pairwise comparisons", PAIRS))
        steps.append(("Ratings: cumulative-link model", CUMULATIVE))
        steps.append(("Ratings: check on ranks", RANKS.format(seed=seed)))
    if data.strengths is not None:
        steps.append(("Psychometric function", STRENGTHS.format(seed=seed)))
    if data.thresholds is not None:
        steps.append(("Thresholds of adaptive blocks", THRESHOLDS))
    steps.append(("Figures", FIGURES))
    for name, code in steps:
        cells += [_cell(f"## {name}"), _cell(code, code=True)]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _cell(source: str, *, code: bool = False) -> dict[str, object]:
    lines = source.strip("\n").splitlines(keepends=True)
    if not code:
        return {"cell_type": "markdown", "metadata": {}, "source": lines}
    return {"cell_type": "code", "metadata": {}, "source": lines, "outputs": [], "execution_count": None}
