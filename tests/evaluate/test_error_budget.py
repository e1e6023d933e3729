import json
from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import Leak, StageOutput, budget, error_by_energy, leak, surroundings
from midair.model import Acoustics, ControlGrid, Drive, Medium, PressureFrames, Provenance, TransducerArray
from midair.physics import focus_phase, radiation_pressure, transfer_matrix

TIME = np.arange(2000) / 2000


def frames(*parts, simulated=False):
    pressure = np.zeros((2000, 4, 4))
    for frequency, amplitude in parts:
        pressure[:, 1, 2] += amplitude * np.sin(2 * np.pi * frequency * TIME) * np.hanning(2000)
    return PressureFrames(pressure=pressure, rate=2000.0, provenance=Provenance(simulated=simulated))


@pytest.fixture
def made():
    original = frames((100, 1))
    first = frames((100, 1), (210, 0.1))
    second = frames((100, 1), (210, 0.1), (330, 0.1), simulated=True)
    leak = Leak(peak=0.5, typical=0.2, place=(0.0, 0.0), wanted=10.0)
    outputs = [StageOutput(name="first", what="", pressure=first)]
    outputs += [StageOutput(name="second", what="", pressure=second, leak=leak)]
    life = Provenance().then("not reproduced", {"text": "a tenth"})
    return budget(replace(original, provenance=life), outputs, strength=0.1)


def test_stages_alone_and_so_far_by_hand_and_simulated_once_is_simulated(made):
    assert made.stage("first").so_far.distortion_ratio == pytest.approx(20, abs=0.05)
    assert made.stage("first").alone == made.stage("first").so_far
    # alone: .1 more in 1 + .01 of power; cumulative: twice .01
    assert made.stage("second").alone.distortion_ratio == pytest.approx(10 * np.log10(101), abs=0.1)
    assert made.stage("second").so_far.distortion_ratio == pytest.approx(10 * np.log10(50), abs=0.05)
    assert made.simulated
    assert not budget(frames((100, 1)), [], strength=0.1).simulated


def test_json_has_every_stage_and_no_infinity(made):
    perfect = budget(frames((100, 1)), [StageOutput(name="none", what="", pressure=frames((100, 1)))], strength=0.1)
    plain = made.plain()
    assert [stage["stage"] for stage in plain["stages"]] == ["first", "second"]
    assert plain["stages"][1]["leak"] == 0.5
    assert plain["left_out"] == "a tenth"
    assert "Infinity" not in json.dumps(plain) + json.dumps(perfect.plain())
    assert plain["losses_db"] == pytest.approx({"first": 40.0, "second": 3.0}, abs=0.05)


def test_distortion_that_a_later_stage_cancels_costs_nothing():
    clean, pushed = frames((100, 1)), frames((100, 1), (210, 0.3))
    field, sensor = (frames((100, 1), (330, amplitude)) for amplitude in (0.01, 0.1))
    steps = {"beforehand": pushed, "mapping": pushed, "field": field, "sensor": sensor}
    outputs = [StageOutput(name=name, what="", pressure=each) for name, each in steps.items()]
    losses = [(stage.name, round(loss)) for stage, loss in budget(clean, outputs, strength=0.1).losses()]
    assert losses == [("field", 20), ("sensor", 20)]
    perfect = budget(clean, [StageOutput(name="only", what="", pressure=clean)], strength=0.1).losses()
    assert [(stage.name, loss) for stage, loss in perfect] == [("only", 0.0)]


def test_the_error_by_energy_is_the_norm_of_all_frames_in_which_faint_ones_hardly_count():
    rng = np.random.default_rng(0)
    asked = rng.random((50, 7)) + 0.2
    came = asked + 0.1 * rng.standard_normal(asked.shape)
    each = np.linalg.norm(came - asked, axis=1) / np.linalg.norm(asked, axis=1)
    found = error_by_energy(each, (asked**2).sum(axis=1))
    assert found.energy == pytest.approx(np.linalg.norm(came - asked) / np.linalg.norm(asked))
    assert found.faint == 0
    assert found.faint_text() == ""
    assert error_by_energy(np.array([0.5, np.nan]), np.array([1.0, 0.0])).mean == 0.5
    names = ("E_energy", "E_mean", "E_worst", "faint_frames", "E_faint")
    assert error_by_energy(np.zeros(3), np.zeros(3)).plain() == dict.fromkeys(names, 0)
    # Nine frames with 3 % error, and ninety-one of a ten-thousandth of their power with an error of 100.
    error = np.r_[np.full(9, 0.03), np.full(91, 100.0)]
    power = np.r_[np.full(9, 4.0), np.full(91, 4e-10)]
    found = error_by_energy(error, power)
    assert (found.mean, found.worst, found.faint, found.frames) == (pytest.approx(0.03), 0.03, 91, 100)
    assert found.energy == pytest.approx(np.sqrt((9 * 0.03**2 + 91 * 1e-10 * 1e4) / 9), rel=1e-6)
    assert found.faint_text().startswith("91 of 100 ")
    assert "--set solver.level=auto" in found.faint_text()


ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid()


def focused(place, levels=(1.0,)):
    phase = np.tile(focus_phase(ARRAY, np.array([*place, GRID.height])), (len(levels), 1))
    return Drive(phase=phase, level=np.array(levels), rate=1000.0, array=ARRAY)


def wanted(amplitude, frames=1):
    target = np.zeros((frames, GRID.count))
    target[0, 0] = amplitude
    return target


def test_the_surroundings_are_outside_the_square_and_nowhere_else():
    around, outside = surroundings(GRID)
    places = around.position[:, :2]
    half = 16 * 11e-3 / 3 / 2
    assert (outside == (np.abs(places).max(axis=1) > half + 1e-9)).all()
    assert 0.02 <= places.max() - half < 0.02 + 2 * 2.5e-3


def test_a_focus_outside_by_hand_and_one_inside_leaks_its_side_lobes_only():
    place = (0.04, 0.0)
    found = leak(focused(place), wanted(2000.0), GRID)
    G = transfer_matrix(np.array([[*place, GRID.height]]), ARRAY, acoustics=Acoustics(directivity="t4010a1"))
    pressure = radiation_pressure(np.abs(G).sum(axis=1), Medium())[0]
    assert found.peak == pytest.approx(pressure / radiation_pressure(np.array(2000.0), Medium()), rel=1e-3)
    assert found.place == pytest.approx(place, abs=1.3e-3)
    assert found.typical == found.peak
    assert leak(focused((0.0, 0.0)), wanted(2000.0), GRID).peak < 0.2 * found.peak


def test_pressure_goes_with_the_square_of_the_level_and_the_strongest_frame_decides():
    weak, strong = (
        leak(focused((0.04, 0.0), levels), wanted(1e3, len(levels)), GRID) for levels in ((0.5,), (1.0, 0.5, 0.5))
    )
    assert strong.peak == pytest.approx(4 * weak.peak, rel=1e-9)
    assert strong.typical == pytest.approx(weak.peak, rel=1e-9)
    assert leak(focused((0.0, 0.0)), wanted(0.0), GRID).peak == 0
