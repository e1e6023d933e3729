import csv

import numpy as np
import pytest

from midair.errors import InputError
from midair.sweep.pattern_report import PatternResults, examples_of, report_of, write_sweep_report
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.run import do
from midair.sweep.store import load_sweep, open_sweep

SWEEP = PatternSweep(count=24, curve_count=6, chunk=8, method="naive")


@pytest.fixture(scope="module")
def results(finished, tmp_path_factory):
    return PatternResults.of(finished(tmp_path_factory.mktemp("sweep") / "s.zarr", SWEEP))


def made_up(error, sweep=SWEEP):
    shape = (len(sweep.conditions()), len(sweep.patterns()))
    error = np.broadcast_to(error, shape)
    return PatternResults(sweep=sweep, patterns=sweep.patterns(), error=error, rounded_error=error + 0.01, seconds=12.0)


def test_figures_of_numbers_known_by_hand():
    report = report_of(made_up(0.01 * np.arange(24)))
    row = next(one for one in report.conditions if one["strength"] == 0.1 and one["height_mm"] == 200)
    assert row["patterns"] == 24
    assert row["mean"] == pytest.approx(0.115)
    assert row["median"] == pytest.approx(0.115)
    assert row["worst"] == pytest.approx(0.23)
    assert row["worst_pattern"] == f"{SWEEP.patterns()[-1]:#06x}"
    assert row["share_5_to_15"] == pytest.approx(11 / 24)
    assert row["mean_rounded"] == pytest.approx(0.125)
    assert "12 s" in report.words


def test_rows_by_channels_add_up_to_the_whole():
    report = report_of(made_up(0.01 * np.arange(24)))
    rows = [row for row in report.channels if row["strength"] == 0.2]
    assert sum(row["patterns"] for row in rows) == 24
    assert sum(row["patterns"] * row["mean"] for row in rows) / 24 == pytest.approx(0.115)
    loud = sorted(int(pattern).bit_count() for pattern in SWEEP.patterns())
    assert [row["channels"] for row in rows] == sorted(set(loud))


@pytest.mark.long
def test_examples_are_the_patterns_that_were_stored(results):
    """Solved again, they have the stored errors, from the best pattern to the worst."""
    examples = examples_of(results, 0, quantiles=(0, 1))
    stored = results.error[0]
    assert [one.error for one in examples] == pytest.approx([stored.min(), stored.max()], rel=1e-9)
    for one in examples:
        missed = np.linalg.norm(one.field - one.target) / np.linalg.norm(one.target)
        assert missed == pytest.approx(one.error, rel=1e-9)
    assert examples[0].name == f"{results.patterns[stored.argmin()]:#06x}"


@pytest.mark.long
def test_writes_tables_and_figures(results, tmp_path):
    files = write_sweep_report(results, tmp_path / "report")
    assert {file.name for file in files} == {
        "conditions.csv",
        "channels.csv",
        "histogram.csv",
        "histogram.png",
        "examples.png",
        "strength.png",
        "height.png",
    }
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files if file.suffix == ".png")
    with (tmp_path / "report" / "conditions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(SWEEP.conditions())
    assert float(rows[0]["mean"]) == pytest.approx(report_of(results).conditions[0]["mean"], rel=1e-5)
    with (tmp_path / "report" / "histogram.csv").open() as file:
        counts = [int(row["strength_0.1_at_200mm"]) for row in csv.DictReader(file)]
    assert sum(counts) == 24


@pytest.mark.long
def test_a_sweep_without_curves_has_no_figures_of_them(tmp_path):
    sweep = PatternSweep(count=8, curve_count=0, chunk=8, method="naive", strengths=(0.1,))
    path = tmp_path / "s.zarr"
    with open_sweep(path, sweep) as store:
        store.write(do(sweep.job(sweep.tasks()[0]), sweep.tasks()[0]))
    files = write_sweep_report(PatternResults.of(load_sweep(path)), tmp_path / "report")
    assert "strength.png" not in {file.name for file in files}


def test_an_unfinished_sweep_is_reported():
    error = np.full((len(SWEEP.conditions()), 24), np.nan)
    error[0, :8] = 0.1
    report = report_of(made_up(error))
    assert len(report.conditions) == 1
    assert "8 of" in report.words


def test_a_sweep_that_has_just_begun_says_so():
    with pytest.raises(InputError, match="none so far"):
        report_of(made_up(np.nan))
