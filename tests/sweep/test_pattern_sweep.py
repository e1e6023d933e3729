"""Sweeps over patterns, solved in this process."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError, MidairError, MismatchError, MissingFileError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, SensorGrid, TransducerArray
from midair.sweep import PatternSweep, SweepResults, load_sweep, run_sweep, sweep_report, write_sweep_report

SWEEP = PatternSweep(count=10, chunk=4, strengths=(0.1, 0.2), iterations=2)


@pytest.fixture
def cheap(monkeypatch):
    """Tasks that cost nothing; E is the place of a pattern."""

    def job(sweep, task):
        error = np.arange(task.first, task.last) / 100 + 0.01
        return lambda: {"error": error, "rounded_error": 2 * error, "strength": sweep.conditions()[task.condition][1]}

    monkeypatch.setattr(PatternSweep, "job", job)


def made_up(error, **changes):
    """Results with these errors of 24 patterns at three strengths."""

    sweep = PatternSweep(**({"count": 24, "strengths": (0.1, 0.2, 0.3)} | changes))
    error = np.broadcast_to(error, (len(sweep.conditions()), sweep.count))
    return SweepResults(
        kind="patterns",
        settings=json.loads(json.dumps(sweep.settings())),
        error=error,
        rounded_error=error + 0.01,
        strength=np.array([0.1, 0.2, 0.3]),
        seconds=12.0,
        complete=True,
    )


def test_the_default_is_the_paper_s_experiment_and_tasks_are_every_pattern_of_every_condition_once():
    sweep = PatternSweep()
    assert len(sweep.patterns()) == len(set(sweep.patterns())) == 65535
    assert sweep.conditions() == [(0.2, 0.1), (0.2, 0.2)]
    assert sweep.acoustics == Acoustics(medium=Medium(attenuation=0.0), directivity="point")
    tasks = SWEEP.tasks()
    done = [(task.condition, item) for task in tasks for item in range(task.first, task.last)]
    assert sorted(done) == [(condition, item) for condition in (0, 1) for item in range(10)]
    assert [task.first for task in tasks] == sorted(task.first for task in tasks)
    assert len({task.file for task in tasks}) == len(tasks) == 6


def test_a_sweep_is_resumed_by_what_is_there(tmp_path, here, cheap):
    reports, folder = [], tmp_path / "s"
    assert run_sweep(SWEEP, folder, progress=lambda *numbers: reports.append(numbers)) == 20
    assert reports == [(0, 20), (4, 20), (8, 20), (12, 20), (16, 20), (18, 20), (20, 20)]
    first = load_sweep(folder)
    assert first.complete
    assert np.isfinite(first.error).all()
    np.testing.assert_allclose(first.strength, [0.1, 0.2])
    assert (first.error != first.rounded_error).all()
    assert run_sweep(SWEEP, folder) == 0
    # A lost file is solved again, with the same result, and one of a crash is ignored.
    (folder / SWEEP.tasks()[3].file).unlink()
    (folder / ".0001-000000.npz.part").write_bytes(b"half")
    part = load_sweep(folder)
    assert not part.complete
    assert np.isnan(part.error[1]).tolist() == 4 * [False] + 4 * [True] + 2 * [False]
    assert run_sweep(SWEEP, folder) == 4
    np.testing.assert_array_equal(load_sweep(folder).error, first.error)

    for change, words in (
        ({"seed": 7}, "expected seed 7, got a sweep with 2024"),
        ({"strengths": (0.1, 0.3)}, r"strengths \[0.1, 0.3\], got a sweep with \[0.1, 0.2\]"),
        ({"iterations": None}, "iterations None, got a sweep with 2"),
        ({"bits": 4}, "bits 4, got a sweep with 8"),
        ({"count": 9}, "count 9, got a sweep with 10"),
    ):
        with pytest.raises(MismatchError, match=words):
            run_sweep(replace(SWEEP, **change), folder)
    known = json.loads((folder / "sweep.json").read_text())
    assert known["simulated"] is True
    (folder / "sweep.json").write_text(json.dumps(known | {"midair": "0.0.1"}))
    with pytest.raises(MismatchError, match=r"expected midair .*, got a sweep with '0.0.1'"):
        run_sweep(SWEEP, folder)
    (folder / "sweep.json").unlink()
    with pytest.raises(MismatchError, match="got other files"):
        run_sweep(SWEEP, folder)


def test_damaged_files_are_one_line(tmp_path, here, cheap):
    sweep, folder = replace(SWEEP, count=2, strengths=(0.1,)), tmp_path / "s"
    with pytest.raises(MissingFileError, match="midair sweep patterns"):
        load_sweep(folder)
    run_sweep(sweep, folder)
    right, part, rng = load_sweep(folder), folder / sweep.tasks()[0].file, np.random.default_rng(5)
    whole = part.read_bytes()
    for place in rng.integers(8 * len(whole), size=60):
        spoilt = bytearray(whole)
        spoilt[place // 8] ^= 1 << place % 8
        part.write_bytes(spoilt)
        try:
            np.testing.assert_array_equal(load_sweep(folder).error, right.error)
        except BrokenFileError as wrong:
            assert "delete the file" in str(wrong)
    part.write_bytes(whole)
    settings = json.loads((folder / "sweep.json").read_text())
    shapes = [{"shape": 1}, {"shape": [1, 10**15]}]
    for change in [*shapes, {"settings": 3}, {"settings": {"x": 1}}, {"kind": "recordings"}]:
        (folder / "sweep.json").write_text(json.dumps(settings | change))
        with pytest.raises(MidairError):
            sweep_report(load_sweep(folder))


def test_tables_of_numbers_known_by_hand():
    tables = sweep_report(made_up(0.01 * np.arange(24)))
    row = tables["conditions"][0]
    assert (row["strength"], row["height_mm"], row["patterns"]) == (0.1, 200, 24)
    for name, expected in {"mean": 0.115, "median": 0.115, "worst": 0.23, "share_5_to_15": 11 / 24}.items():
        assert row[name] == pytest.approx(expected)
    assert row["mean_rounded"] == pytest.approx(0.125)
    patterns = PatternSweep(count=24).patterns()
    assert row["worst_pattern"] == f"{patterns[-1]:#06x}"
    rows = [row for row in tables["channels"] if row["strength"] == 0.2]
    assert sum(row["patterns"] for row in rows) == 24
    assert sum(row["patterns"] * row["mean"] for row in rows) / 24 == pytest.approx(0.115)
    assert [row["channels"] for row in rows] == sorted({int(pattern).bit_count() for pattern in patterns})
    # An unfinished sweep has the conditions with results.
    some = np.full((3, 24), np.nan)
    with pytest.raises(InputError, match="continue with midair sweep patterns"):
        sweep_report(made_up(some))
    some[1, :8] = 0.1
    assert [(row["strength"], row["patterns"]) for row in sweep_report(made_up(some))["conditions"]] == [(0.2, 8)]


@pytest.mark.long
def test_writes_tables_and_figures(tmp_path):
    """Curves where there are three values of strength or height."""
    files = write_sweep_report(made_up(0.01 * np.arange(24)), tmp_path / "report")
    names = ["conditions.csv", "channels.csv", "histogram.png", "strength.png"]
    assert [file.name for file in files] == names
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files[2:])
    with files[0].open() as file:
        assert [float(row["mean"]) for row in csv.DictReader(file)] == pytest.approx([0.115] * 3)


@pytest.mark.long
def test_equals_the_solver_on_targets_in_pascal(tmp_path, here):
    from midair.physics import focus_amplitude
    from midair.solvers import solve
    from midair.targets import interpolation_matrix

    array, grid = TransducerArray.autd3(), ControlGrid(height=0.25)
    acoustics = Acoustics(medium=Medium(attenuation=0), directivity="point")
    sweep = PatternSweep(count=3, strengths=(0.15,), heights=(0.25,), iterations=2)
    run_sweep(sweep, tmp_path / "s")
    found = load_sweep(tmp_path / "s")
    loud = (sweep.patterns()[:, None] >> np.arange(16)) & 1
    sound = 0.15 * focus_amplitude(grid, array, acoustics=acoustics) * loud @ interpolation_matrix(SensorGrid(), grid).T
    target = AmplitudeFrames(amplitude=sound, rate=1.0, grid=grid)
    for bits, error in ((None, found.error), (8, found.rounded_error)):
        solution = solve(target, array, method="fast", iterations=2, acoustics=acoustics, bits=bits)
        np.testing.assert_allclose(error[0], solution.error, rtol=1e-5)
