"""Every example runs, and makes at least one figure.

Slow here, since `make check` runs them all for the gallery and fails where one does.
"""

import runpy
from pathlib import Path

import pytest
from matplotlib.figure import Figure

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("plot_*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_runs_and_leaves_a_picture_and_says_where(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path(str(path))
    assert any(isinstance(value, Figure) for value in names.values())
    assert [each.name for each in tmp_path.iterdir()] == [f"{path.stem}.png"]
    assert capsys.readouterr().out.endswith(f"{path.stem}.png\n")
