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
def test_runs(path):
    names = runpy.run_path(str(path))
    assert any(isinstance(value, Figure) for value in names.values())


def test_there_are_examples():
    assert len(EXAMPLES) >= 3
