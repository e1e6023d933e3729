import json

import numpy as np
import pytest

from midair.study import analyse, analysis_notebook, data_of_columns, load_table, read_csv, write_csv

OBJECTS = ["brush", "sponge", "towel"]
COLUMNS = {
    "participant": "who",
    "presented": "object",
    "answered": "answer",
    "condition": "surface",
    "rating": "rating",
}


@pytest.fixture
def made(tmp_path):
    """A table of answers, its notebook in the same folder, and the report of the same data."""
    from pandas import DataFrame

    rng = np.random.default_rng(0)
    who, surface, thing, _ = np.indices((6, 2, 3, 3)).reshape(4, -1)
    right = np.array(OBJECTS)[thing]
    table = {
        "who": np.array([f"s{i}" for i in who]),
        "surface": np.where(surface, "plain", "grooved"),
        "object": right,
        "answer": np.where(rng.random(who.size) < 0.6, right, rng.choice(OBJECTS, who.size)),
        "rating": rng.integers(1, 8, who.size),
    }
    write_csv(DataFrame(table), tmp_path / "old.csv")
    options = {**COLUMNS, "within": ("surface", "object")}
    data = data_of_columns(read_csv(tmp_path / "old.csv"), **options)
    text = analysis_notebook(data, load_table("old.csv", options), title="Old", seed=3, draws=50)
    (tmp_path / "old-report.ipynb").write_text(text, encoding="utf-8")
    return tmp_path, analyse(data, seed=3, draws=50)


def table_of(report, begin):
    return next(one.table for one in report.findings if one.title.startswith(begin))


@pytest.mark.long
def test_the_steps_give_the_numbers_of_the_report(made, monkeypatch):
    # Run the cells as a program: a kernel takes seconds to start.
    folder, report = made
    monkeypatch.chdir(folder)
    pytest.importorskip("IPython")
    monkeypatch.setattr("IPython.display.display", lambda *shown: None)
    known: dict[str, object] = {}
    for cell in json.loads((folder / "old-report.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code" and not any("study_pictures" in line for line in cell["source"]):
            exec(compile("".join(cell["source"]), "cell", "exec"), known)
    mixed, anova = known["mixed"], known["anova"]
    assert mixed["p"].tolist() == pytest.approx(table_of(report, "Mixed model")["p"].tolist())
    assert anova["p_GG"].tolist() == pytest.approx(table_of(report, "Ratings: analysis")["p_GG"].tolist())
    assert [one.words for one in known["report"].findings] == [one.words for one in report.findings]


@pytest.mark.slow
def test_it_runs_in_a_kernel(made):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    folder, report = made
    notebook = nbformat.read(folder / "old-report.ipynb", as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(folder)}}).execute()
    shown = json.dumps(notebook["cells"])
    assert json.dumps(report.findings[1].words)[1:-1] in shown
    assert "image/png" in shown
