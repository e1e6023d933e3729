"""One way from a take to a solved drive."""

import numpy as np
import pytest

from midair.errors import InputError
from midair.files import load_prediction, load_solution, load_target, open_take, save_solution, store_prediction
from midair.model import ControlGrid, TransducerArray
from midair.pipeline import target_amplitude
from midair.pressure_level import predicted
from midair.rig import pressure_of, pressure_to_solve, solve_to_file
from midair.settings import Settings, paper_mode

SETTINGS = paper_mode().but(grid=ControlGrid(rows=4, columns=4, pitch=11e-3), method="fast")


def test_a_part_is_calibrated_as_a_whole_and_then_cut(take_file):
    part, whole = pressure_of(take_file, SETTINGS, 0.4, 0.02), pressure_of(open_take(take_file), SETTINGS)
    np.testing.assert_array_equal(part.pressure, whole.pressure[400:420])
    led = pressure_to_solve(take_file, SETTINGS, 0.4, 0.02, lead=0.01)
    assert led.frames == 40
    np.testing.assert_allclose(led.pressure[10:30], part.pressure, atol=1e-12)
    assert "text" in led.provenance.last("not reproduced")


def test_a_drive_above_its_level_is_solved_again_and_a_refused_one_leaves_no_file(take_file, tmp_path, monkeypatch):
    led = pressure_to_solve(take_file, SETTINGS, 0.4, 0.004, lead=0.0)
    found = iter([SETTINGS.but(gain=0.25), None])
    monkeypatch.setattr("midair.rig.prepare.weaker_settings", lambda *_: next(found))
    path, array = tmp_path / "t.drive.h5", TransducerArray.autd3(columns=1, rows=1)
    target, solution = solve_to_file(led, array, SETTINGS, path)
    assert list(tmp_path.iterdir()) == [path]
    assert Settings.of(load_solution(path).drive.provenance).target.gain == 0.25
    # Sound amplitude goes with the square root of the gain.
    full = target_amplitude(led, SETTINGS.but(gain=1.0)).amplitude
    np.testing.assert_allclose(np.asarray(target.amplitude), full / 2, rtol=2**-13)
    assert load_target(path).frames == solution.drive.frames == 4

    def refuse():
        raise InputError("another one")

    found = iter([None])
    before = path.read_bytes()
    with pytest.raises(InputError, match="another one"):
        solve_to_file(led, array, SETTINGS, path, confirm=refuse)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_what_the_model_predicts_is_stored_and_computed_anew_by_other_code(take_file, tmp_path, monkeypatch):
    path, array = tmp_path / "t.drive.h5", TransducerArray.autd3(columns=1, rows=1)
    target, solution = solve_to_file(
        pressure_to_solve(take_file, SETTINGS, 0.4, 0.02, lead=0.01), array, SETTINGS, path
    )
    save_solution(solution, bare := tmp_path / "bare.drive.h5", target=target)
    (level, felt), computed = predicted(path, solution, target), predicted(bare, solution, target)
    assert (level.plain(), felt) == (computed[0].plain(), computed[1])
    monkeypatch.setattr("midair.pressure_level.felt_of_drive", lambda *_: "computed")
    found = [predicted(each, solution, target)[1] for each in (path, bare)]
    monkeypatch.setattr("midair.pressure_level._digest_of_code", lambda: "another skin")
    assert [*found, predicted(path, solution, target)[1]] == [felt, "computed", "computed"]
    monkeypatch.undo()
    held = load_prediction(path)
    infinite, text = ({**held["level"], "asked": each} for each in (float("inf"), "8 Pa"))
    broken = [{"level": infinite}, {"level": text}, {"level": {}}, {"felt": {}}, {"felt": [1.0]}, {"shares": [None]}]
    for each in [{"code": held["code"]}, *({**held, **one} for one in broken)]:
        store_prediction(path, each)
        assert predicted(path, solution, target)[1] == felt, "of no use, so computed"
