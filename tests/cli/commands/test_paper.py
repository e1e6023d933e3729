import json
from pathlib import Path

import pytest

from midair.cli import run
from midair.cli.commands.paper import _print
from midair.paper import PaperResult


@pytest.mark.slow
def test_figure_4_is_solved_and_played_in_the_stated_air(capsys):
    short = ["--mode", "paper", "--duration", "0.08s", "--iterate", "0"]
    assert run(["paper", "made", "--figure", "4", *short, "--temperature", "24C", "--humidity", "40%"]) == 0
    assert "air: 24 °C, 40 % humidity\n" in capsys.readouterr().err
    assert sorted(path.name for path in Path("made").iterdir()) == ["figure4.csv", "figure4.json", "figure4.png"]
    rows = json.loads(Path("made/figure4.json").read_text())["rows"]
    # A drive for 24 degrees that is played in the paper's 14 has lost half of this.
    assert min(row["correlation"] for row in rows) > 0.8


def test_files_that_are_there_stay(capsys):
    Path("made").mkdir()
    Path("made/figure9.json").write_text("mine")
    assert run(["paper", "made", "--figure", "9"]) == 1
    assert "figure9.json" in capsys.readouterr().err
    assert Path("made/figure9.json").read_text() == "mine"


def test_a_table_of_few_rows_and_many_columns_fits_into_a_terminal(capsys):
    row = {f"{one}_as_{other}": 12 for one in ("brush", "sponge", "towel") for other in ("brush", "sponge", "towel")}
    about: dict[str, object] = {"strokes": [f"brush {number}" for number in range(36)], "duration_s": 0.3}
    _print(PaperResult(name="materials", title="Apart?", rows=(row, row), pictures={}, about=about), [Path("it.csv")])
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    assert "sponge_as_towel   12  12" in said
    assert "36: brush 0 ... brush 35" in said
