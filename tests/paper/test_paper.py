import json

import numpy as np
import pytest

from midair.model import ControlGrid, PressureFrames, SensorGrid
from midair.paper.figures import PATTERNS, PaperResult, figure_3, figure_4, figure_9
from midair.paper.modes_compared import FidelityPlan, at_strength, fidelity_table, original_of, strongest_part
from midair.physics import focus_amplitude
from midair.pipeline import target_amplitude
from midair.settings import Settings

COARSE = ControlGrid(rows=6, columns=6, pitch=11e-3)
PAPER = Settings().but(grid=COARSE, method="fast")
BEST = Settings().but(grid=COARSE, method="fast", mapping="slow-bias", interpolate="pressure", precompensate=True)


def check(result, rows):
    assert len(result.rows) == rows
    assert all(data.startswith(b"\x89PNG") for data in result.pictures.values())
    assert json.loads(json.dumps(result.plain()))["simulated"] is True
    assert {row["mode"].split()[0] for row in result.rows} == {"paper", "best"}


@pytest.mark.slow
def test_figure_3_has_every_pattern_in_both_modes():
    result = figure_3(paper=PAPER.but(iterations=5), best=BEST.but(iterations=5))
    check(result, 2 * len(PATTERNS))
    first = result.rows[0]
    assert first["error_as_printed"] == pytest.approx(first["error"] / COARSE.count)
    assert all(0 < row["error"] < 1 for row in result.rows)


@pytest.mark.slow
def test_figure_4_finds_place_and_frequency_of_each_stimulus():
    # In .08 s, 250 Hz is a stronger line of the third original than 25 Hz, the louder of its two tones.
    result = figure_4(paper=PAPER, best=BEST, duration=0.16, corrections=0, iterate=1)
    check(result, 6)
    for row in result.rows:
        assert row["frequency_reproduced_hz"] == row["frequency_original_hz"]
        assert row["correlation"] > 0.5
    paper, best = result.rows[4:]
    assert best["waveform_error"] < paper["waveform_error"]


@pytest.mark.long
def test_figure_9_has_the_order_that_the_paper_reports():
    """Above 300 Hz towel over sponge over brush on both surfaces; grooves raise low frequencies more than high ones."""
    result = figure_9(takes=1)
    check(result, 12)
    level = {(row["object"], row["surface"], row["mode"]): row for row in result.rows}
    for surface in ("plain", "groove"):
        high = [level[name, surface, "paper"]["level_300_470_hz_db"] for name in ("brush", "sponge", "towel")]
        assert high == sorted(high)
    for name in ("brush", "sponge", "towel"):
        low, high = (
            level[name, "groove", "paper"][band] - level[name, "plain", "paper"][band]
            for band in ("level_20_300_hz_db", "level_300_470_hz_db")
        )
        assert low > high > 0


def test_both_modes_are_compared_at_the_same_strength():
    plan = FidelityPlan(things=("bursts",), paper=PAPER, best=BEST, strength=0.1, duration=0.08)
    for settings in plan.modes.values():
        original = original_of("bursts", plan, settings)
        scaled = at_strength(original, settings, plan).but(precompensate=False)
        target = target_amplitude(original, scaled)
        focus = focus_amplitude(scaled.target.grid, plan.rig.array, acoustics=scaled.acoustics)
        assert target.amplitude.max() / focus == pytest.approx(0.1, rel=0.25)


@pytest.mark.parametrize(
    ("mode", "shown"), [("paper", {"paper"}), pytest.param("quick", {"paper", "quick"}, marks=pytest.mark.slow)]
)
@pytest.mark.long
def test_figure_9_shows_the_mode_of_a_name_beside_the_paper_s(mode, shown):
    assert {row["mode"] for row in figure_9(takes=1, mode=mode).rows} == shown


def test_the_compared_mode_is_chosen_by_name():
    assert list(FidelityPlan(mode="quick").modes) == ["paper", "quick"]
    assert list(FidelityPlan(mode="paper").modes) == ["paper"]


@pytest.mark.slow
def test_the_fidelity_table_has_both_modes_of_each_thing_and_both_loops():
    plan = FidelityPlan(things=("25+250 Hz",), paper=PAPER, best=BEST, duration=0.08, passes=1, points=6)
    result = fidelity_table(plan)
    check(result, 2)
    assert set(result.pictures) == {"budget-25-250-hz.png", "passes.png"}
    paper, best = result.rows
    assert best["sdr_on_skin_db"] > paper["sdr_on_skin_db"] + 5
    loops = result.about["iterative_correction_of_noise"]
    assert all(len(loop["waveform_error"]) + loop["taken_back"] == 2 for loop in loops.values())


def test_files_are_whole_and_infinities_are_null(tmp_path):
    rows = ({"mode": "paper", "value": float("inf")}, {"mode": "best", "value": 1.0})
    result = PaperResult(name="table", title="", rows=rows, pictures={"a.png": b"picture"})
    assert [path.name for path in result.write(tmp_path / "new")] == ["table.csv", "table.json", "a.png"]
    assert json.loads((tmp_path / "new" / "table.json").read_text())["rows"][0]["value"] is None
    assert (tmp_path / "new" / "table.csv").read_text() == "mode,value\npaper,inf\nbest,1\n"
    assert not np.isnan(rows[0]["value"])


def test_the_strongest_part_is_found():
    pressure = np.zeros((3000, 1, 1))
    pressure[1700:1900, 0, 0] = np.cos(2 * np.pi * 100 * np.arange(200) / 1000)
    frames = PressureFrames(pressure=pressure, rate=1000.0, sensor=SensorGrid(rows=1, columns=1))
    assert strongest_part(frames, 0.2).pressure == pytest.approx(pressure[1700:1900], abs=0.05)
    assert strongest_part(frames, 5.0) is frames
