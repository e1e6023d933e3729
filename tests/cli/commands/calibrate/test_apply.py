import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from midair.calibration import measure_calibration
from midair.calibration.measure.referenced_take import noise_signal
from midair.cli import run
from midair.cli.commands.calibrate.measure import drift
from midair.files import load_calibration, load_pressure, save, save_calibration
from midair.model import SensorGrid
from midair.physics import SensorModel, channel_response
from midair.rig.bench.calibration_page import CalibrationBench, practice_bench

MODEL = SensorModel(grid=SensorGrid(rows=1, columns=2, name="palm 3")).with_spread(seed=1)
BENCH = CalibrationBench(model=MODEL, reference_uncertainty=0.01)
PAIR = ["all-a.h5", "--reference", "all-a-ref.h5"]
MEASURE = ["--reference-sensitivity", "50mV/Pa", "--reference-uncertainty", "0.02", "--date", "2026-01-31"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two takes on both cells, one on each, and a quiet one."""
    folder = tmp_path_factory.mktemp("bench")
    rng = np.random.default_rng(0)
    for number, (name, cell) in enumerate((("all-a", None), ("all-b", None), ("cell-0", 0), ("cell-1", 1))):
        recording, reference = BENCH.recordings(noise_signal(5, 8, rng=rng), cell=cell, number=number)
        save(recording, folder / f"{name}.h5")
        save(reference, folder / f"{name}-ref.h5")
    save(BENCH.quiet(8), folder / "quiet.h5")
    return folder


@pytest.fixture
def bench(recorded):
    shutil.copytree(recorded, Path(), dirs_exist_ok=True)


@pytest.fixture
def known():
    take = BENCH.take(noise_signal(5, 8, rng=np.random.default_rng(1)))
    save_calibration(measure_calibration([take], date="2026-01-31"), "palm.calibration.h5")
    save(BENCH.recordings(noise_signal(5, 2, rng=np.random.default_rng(2)))[0], Path("take.h5"))


@pytest.mark.long
def test_from_takes_to_a_calibration_with_its_page(bench, capsys, answer):
    takes = ["all-a.h5", "all-b.h5", "--reference", "all-a-ref.h5", "all-b-ref.h5", "--quiet", "quiet.h5"]
    told = answer("calibrate", "measure", *takes, *MEASURE)
    assert told["written"] == "palm-3-2026-01-31.calibration.h5"
    assert told["simulated"] is True
    assert "± 2" in told["uncertainty"]
    found = load_calibration(told["written"])
    assert (found.date, found.version, found.sensor.name) == ("2026-01-31", 1, "palm 3")
    at = np.array([100.0])
    apart = np.abs(found.response_at(at) / channel_response(MODEL, at)) - 1
    assert (np.abs(apart) < 2 * found.uncertainty_at(at)).all()
    assert run(["info", told["written"]]) == 0
    said = capsys.readouterr().out
    assert found.identifier in said
    assert "noise-equivalent pressure" in said


@pytest.mark.long
def test_each_cell_alone_gives_the_crosstalk(bench):
    takes = ["cell-0.h5", "cell-1.h5", "--reference", "cell-0-ref.h5", "cell-1-ref.h5"]
    assert run(["calibrate", "measure", *takes, *MEASURE, "--output", "a.calibration.h5"]) == 0
    assert load_calibration("a.calibration.h5").crosstalk.matrix == pytest.approx(np.eye(2), abs=1e-3)
    # the same, told on the command line
    again = [*takes, *MEASURE, "--cell", "0", "1", "--output", "b.calibration.h5", "--figure", "page.png"]
    assert run(["calibrate", "measure", *again]) == 0
    assert load_calibration("b.calibration.h5").identifier == load_calibration("a.calibration.h5").identifier
    assert Path("page.png").read_bytes().startswith(b"\x89PNG")
    assert run(["calibrate", "cell-0.h5", "--calibration", "a.calibration.h5", "--crosstalk", "undo"]) == 0
    assert load_pressure("cell-0.h5").provenance.steps[-1].settings["crosstalk"].startswith("undone")


@pytest.mark.long
def test_a_new_one_takes_the_place_of_an_old_one(bench, known, capsys):
    takes = [*PAIR, *MEASURE, "--supersedes", "palm.calibration.h5"]
    assert run(["calibrate", "measure", *takes, "--output", "new.calibration.h5"]) == 0
    assert load_calibration("new.calibration.h5").version == 2
    assert "E_n" in capsys.readouterr().out


@pytest.mark.long
def test_a_force_cell_has_a_face(bench):
    """50 mV/Pa on a face of 2 mm are 15.9 kV/N: absurd, but the same pressure."""
    force = f"--reference-sensitivity {0.05 / (np.pi * 1e-6):.9g}V/N --reference-diameter 2mm --date 2026-01-31".split()
    for name, options in (("a", force), ("b", MEASURE)):
        assert run(["calibrate", "measure", *PAIR, *options, "--output", f"{name}.calibration.h5"]) == 0
    one, other = (load_calibration(f"{name}.calibration.h5") for name in "ab")
    assert one.response == pytest.approx(other.response, rel=1e-6)


@pytest.mark.long
def test_a_recording_names_its_calibration(known, answer):
    assert run(["calibrate", "take.h5", "--calibration", "palm.calibration.h5"]) == 0
    told = answer("info", "take.h5")
    known = load_calibration("palm.calibration.h5")
    assert (told["calibration"]["id"], told["calibration"]["version"]) == (known.identifier, 1)
    assert told["calibration"]["date"] == "2026-01-31"
    assert told["uncertainty"].startswith("±")


def test_the_calibration_of_another_sensor_is_refused(known, one_line):
    other = CalibrationBench(model=SensorModel(grid=SensorGrid(rows=1, columns=2, name="palm 4")))
    save(other.recordings(noise_signal(5, 2, rng=np.random.default_rng(2)))[0], Path("other.h5"))
    before = Path("other.h5").read_bytes()
    assert run(["calibrate", "other.h5", "--calibration", "palm.calibration.h5"]) == 1
    assert "expected one of sensor 'palm 4', 1 x 2, got one of 'palm 3'" in one_line()
    assert Path("other.h5").read_bytes() == before


@pytest.mark.long
def test_practice_writes_the_inputs_of_measure(capsys, one_line, monkeypatch):
    assert practice_bench(3).model.gain == pytest.approx(practice_bench(3).model.gain)
    assert run(["calibrate", "bench", "lab", "--duration", "1s"]) == 0
    said = capsys.readouterr().out
    assert "midair calibrate measure lab/all-*Pa.h5" in said
    assert len(list(Path("lab").glob("*.h5"))) == 2 * 21 + 1
    assert run(["calibrate", "bench", "lab"]) == 1
    assert "already exists" in one_line()


def test_wrong_input_gives_one_line_a_status_and_leaves_nothing(bench, one_line):
    before = {path.name: path.read_bytes() for path in Path().iterdir()}
    for tokens, word in (
        (["measure", *PAIR], "--reference-sensitivity"),
        (["measure", *PAIR, "--reference-sensitivity", "5mm"], "--reference-sensitivity"),
        (["measure", *PAIR, *MEASURE, "--cell", "left"], "--cell"),
        (["measure", *PAIR, *MEASURE, "--cell", "0"], "no take on cells 1"),
        (["measure", *PAIR, *MEASURE, "--output", "a.h5"], ".calibration.h5"),
        (["measure", *PAIR, *MEASURE, "--output", "all-a.h5"], "--force"),
        (["measure", "all-a.h5", "--reference", "all-b-ref.h5", *MEASURE], "coherence"),
        (["measure", "x.h5", "--reference", "all-a-ref.h5", *MEASURE], "x.h5"),
        (["all-a.h5", "--sensitivity", "20mV/Pa", "--crosstalk", "undo"], "press on each"),
    ):
        assert run(["calibrate", *tokens]) == 1, tokens
        assert word in one_line()
        assert {path.name: path.read_bytes() for path in Path().iterdir()} == before, tokens


@pytest.mark.slow
def test_a_beam_on_the_virtual_rig(capsys):
    assert run(["calibrate", "beam", "--levels", "5", "--output", "a.calibration.h5", "--figure", "a.html"]) == 0
    assert "air: 22 °C, 50 % humidity, assumed; state yours" in capsys.readouterr().err
    found = load_calibration("a.calibration.h5")
    assert found.linearity.levels == 5
    assert "SIMULATED" in Path("a.html").read_text(encoding="utf-8")


def test_a_drift_at_hand_computed_numbers(known):
    old = load_calibration("palm.calibration.h5")
    moved = replace(old, response=1.05 * old.response)
    told = drift(old, moved)
    assert "changed by 5 % (median), at most 5 %" in told
    # both are sure to much less than 5 %
    assert "100.0 % above 1" in told
    assert "E_n 0 (median), 0.0 % above 1" in drift(old, old)
    assert "no frequency in common" in drift(old, replace(old, frequency=old.frequency + 1000))
