"""The commands loop, compare and budget as a person types them."""

import html
import re
import shlex
from pathlib import Path

import pytest

from midair.cli import run

QUICK = shlex.split(
    "--mode paper --set target.grid={rows=6,columns=6,pitch=0.011} --method fast --start-at 0.1s --duration 0.08s"
)

pytestmark = pytest.mark.usefixtures("with_take")


@pytest.mark.long
def test_an_iterative_loop_prints_passes_and_perceptual_metrics(answer):
    told = answer("loop", "take.h5", *QUICK, "--iterate", "2", "--force")
    assert told["simulated"] is True
    assert (len(told["passes"]) + told["taken_back"], [one["step"] for one in told["passes"][:2]]) == (4, [None, None])
    errors = [one["figures"]["waveform error"]["value"] for one in told["passes"][1:]]
    assert errors == sorted(errors, reverse=True)
    assert {"ST-SIM", "SPQI", "Pacinian power difference"} <= {each["name"] for each in told["perception"]}
    page = Path(told["report"]).read_text(encoding="utf-8")
    assert "array measured" in told["verdict"]["lines"]["laboratory"]
    for words in ("SIMULATED", "Perceptual metrics", "of each pass", "do not notice", "In a real laboratory"):
        assert words in page


def figures_of_passes(page):
    return re.findall(r"<h3>Each pass</h3>.*?</table>", page.read_text(encoding="utf-8"), re.DOTALL)[0]


@pytest.mark.slow
def test_the_same_by_hand_has_every_option_quotes_names_and_gives_the_same_figures(capsys):
    Path("a take.h5").write_bytes(Path("take.h5").read_bytes())
    report, other = Path("mine & yours.html"), Path("equal.html")
    common = [*QUICK[:4], "--method", "lm", "--start-at", "0.1s", "--duration", "0.05s", "--corrections", "0"]
    typed = ["loop", "a take.h5", str(report), *common, "--seed", "3", "--set", "solver.amplitudes=bounded"]
    assert run(typed) == 0
    (said,) = re.findall(r"<pre>(.*?)</pre>", report.read_text(encoding="utf-8"), re.DOTALL)
    (line,) = html.unescape(said).strip().splitlines()
    assert shlex.split(line) == ["midair", *typed]
    first = figures_of_passes(report)
    assert run([*shlex.split(line)[1:], "--force"]) == 0
    assert figures_of_passes(report) == first
    # The option did reach it: equally loud transducers have other figures.
    assert run(["loop", "a take.h5", str(other), *common, "--seed", "3"]) == 0
    assert figures_of_passes(other) != first


@pytest.mark.long
def test_budget_as_json_and_as_a_figure(answer):
    words = [*QUICK, "--band", "150Hz", "470Hz"]
    told = answer("budget", "take.h5", "budget.png", *words)
    assert told["stages"][0]["stage"] == "mapping"
    assert "the slow press below 150 Hz" in told["left_out"]
    assert answer("solve", "take.h5", *words)["not_reproduced"]["text"] == told["left_out"], "the same part, once"
    assert sum(told["losses_db"].values()) == pytest.approx(60 - told["stages"][-1]["sdr_so_far_db"], abs=1e-6)
    assert (told["palm"]["palm"], len(told["palm"]["sdr_displacement_db"])) == ("disc of 85 mm", 4)
    assert Path("budget.png").read_bytes().startswith(b"\x89PNG")
