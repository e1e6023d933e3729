import pickle
import re
from copy import deepcopy
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from midair import model
from midair.model import (
    AmplitudeFrames,
    ArrayCalibration,
    Calibration,
    Drive,
    Measurement,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    Solution,
    Step,
    TransducerArray,
)
from midair.model.provenance import clipped, clipped_list, counted, frames_and_duration, short, span


def test_a_step_is_added_and_the_past_kept_and_cannot_be_changed():
    before = Provenance(source="virtual:towel", notes={"object": "towel"})
    after = before.then("calibrate", {"band_hz": (20.0, 470.0)}).then("cut", {}).then("cut", {"start_s": 2.0})
    assert [step.stage for step in after.steps] == ["calibrate", "cut", "cut"]
    assert after.steps[0].settings["band_hz"] == (20.0, 470.0)
    assert (after.source, after.notes) == (before.source, before.notes)
    assert before.steps == ()
    assert after.last("cut")["start_s"] == 2.0
    assert dict(after.last("play")) == {}
    assert not after.simulated
    assert Provenance(simulated=True).then("solve", {}).simulated
    assert before.then("play", {}, simulated=True).then("compare", {}).simulated, "what was simulated once stays so"
    settings = {"taps": 201}
    step = Step(stage="calibrate", settings=settings)
    settings["taps"] = 0
    assert step.settings["taps"] == 201
    with pytest.raises(TypeError):
        step.settings["taps"] = 1
    with pytest.raises(TypeError):
        Provenance(notes={"a": "b"}).notes["a"] = "c"


LONG = "<b>" + "a very long name " * 40 + "\n</b>"
RNG = np.random.default_rng(4)

TOWEL = Provenance(source="virtual:towel", simulated=True, notes={"object": "towel"}).then("cut", {"start_s": 0.5})
SENSOR = SensorGrid(name="virtual sensor 0")
FOUR = TransducerArray.autd3()


def measurement(**words):
    cells = np.full((257, 4, 4), 0.021)
    parts = dict.fromkeys(("coherence", "magnitude_uncertainty", "phase_uncertainty", "noise_density"), cells)
    parts |= dict.fromkeys(("noise_uncertainty", "delay", "delay_uncertainty"), np.full((4, 4), 1.25e-4))
    return Measurement(**parts, **words)


def solution(drive, status="converged"):
    frames = drive.frames
    error = np.linspace(0.05, 0.091, frames) * (status != "silent")
    return Solution(drive=drive, error=error, iterations=np.ones(frames, int), status=(status,) * frames)


RECORDED = {"rate": 1000.0, "provenance": TOWEL}
UNCERTAIN = dict.fromkeys(
    (f"{name}_uncertainty" for name in ("strength", "phase", "resonance", "quality")), np.ones(996)
)
ORDINARY = (
    AmplitudeFrames(amplitude=RNG.uniform(0, 3800, (50, 256)), **RECORDED),
    ArrayCalibration(
        array=FOUR, response=np.ones(996), pole=np.full(996, -5e3 + 3e2j), dead=np.arange(996) < 3, **UNCERTAIN,
        provenance=TOWEL,
    ),
    Calibration(
        sensor=SENSOR, frequency=np.linspace(0, 500, 257), response=RNG.uniform(0.01, 0.02, (257, 4, 4)),
        noise=np.zeros((4, 4)), date="2026-01-31", provenance=TOWEL, measurement=measurement(),
    ),
    Drive(phase=RNG.uniform(0, 7, (50, 996)), level=np.ones(50), array=FOUR, **RECORDED),
    measurement(reference="microphone", takes=3),
    PressureFrames(pressure=RNG.standard_normal((1280, 4, 4)), sensor=SENSOR, band=(20.0, 470.0), **RECORDED),
    TOWEL,
    Recording(samples=RNG.standard_normal((1280, 4, 4)), sensor=SENSOR, **RECORDED),
    Step(stage="cut", settings={"start_s": 0.5}),
    FOUR,
)  # fmt: skip
ORDINARY = {type(each).__name__: each for each in ORDINARY}
ORDINARY["Solution"] = solution(ORDINARY["Drive"])
"""Ordinary objects with arrays or a provenance."""

STAGES = "AmplitudeFrames ArrayCalibration Calibration Drive PressureFrames Provenance Recording Solution"

STEPS = tuple(Step(stage=f"{LONG}{i}", settings={LONG: LONG}) for i in range(20))
BUSY = Provenance(source=LONG, simulated=True, notes={f"{LONG}{i}": LONG for i in range(20)}, steps=STEPS)
ONE = SensorGrid(rows=1, columns=1, name=LONG)
ALONE = TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0.0, 0, 1]]))
QUIET = Drive(phase=np.zeros((1, 1)), level=np.zeros(1), rate=1e9, array=ALONE, provenance=BUSY)

EXTREME = {
    "one frame, one cell": Recording(samples=np.zeros((1, 1, 1)), rate=12345.678901, sensor=ONE, provenance=BUSY),
    "solution that is silent": solution(QUIET, "silent"),
    "step with many settings": Step(stage=LONG, settings={f"{LONG}{i}": tuple(range(99)) for i in range(99)}),
}
"""Objects with the longest, emptiest or most constant data."""

NOUNS = ORDINARY | EXTREME


def test_a_repr_is_one_short_line_without_the_numbers_of_an_array_and_marks_simulated_data():
    classes = [each for each in vars(model).values() if is_dataclass(each)]
    printed = [each for each in classes if any("ndarray" in str(field.type) for field in fields(each))]
    assert printed
    assert [each for each in printed if hasattr(each.__repr__, "__wrapped__")] == []
    said = [repr(noun) for noun in NOUNS.values()]
    assert [line for line in said if len(line) >= 300 or re.search(r"\n|array\(|\[|\b(nan|inf)\b", line)] == []
    assert {name for name, noun in ORDINARY.items() if "SIMULATED" in repr(noun)} == set(STAGES.split())


def test_a_repr_has_the_main_figures_with_units():
    said = {name: repr(ORDINARY[name]) for name in ("Recording", "Calibration", "Solution", "TransducerArray")}
    assert "1280 frames at 1000 Hz, 1.28 s, 4 x 4 'virtual sensor 0'" in said["Recording"]
    assert "257 bins 0 to 500 Hz, 4 x 4 'virtual sensor 0'" in said["Calibration"]
    assert "<Solution E of a frame 5 to 9.1 %, of <Drive 50 frames at 1000 Hz, 0.05 s, 996" in said["Solution"]
    assert "AUTD3 2 x 2, 996 transducers in 4 units, 365 x 283 mm, 40 kHz" in said["TransducerArray"]


def test_a_solution_counts_its_silent_frames_and_leaves_them_out_of_e():
    drive = replace(ORDINARY["Drive"], phase=np.zeros((3, 996)), level=np.array([0.0, 1, 1]))
    some = replace(solution(drive), error=np.array([0.0, 0.1, 0.2]), status=("silent", "stalled", "converged"))
    assert "<Solution E of a frame 10 to 20 %, 1 frame silent, of <Drive 3 frames" in repr(some)
    assert some.plays.tolist() == [False, True, True]
    led = replace(drive, provenance=Provenance().then("lead", {"lead_s": 1 / drive.rate}))
    assert "E of a frame 10 %, 1 frame silent, of <Drive 3 frames" in repr(replace(some, drive=led))
    assert "at 1000 Hz, 0.001 s and 0.001 s of lead at either end" in repr(led)
    assert "<Solution 1 frame silent, of <Drive" in repr(EXTREME["solution that is silent"])


def test_names_lists_and_numbers_are_short_and_have_units():
    assert clipped("C:/takes/of/a/long/winter/towel.h5", 20) == "C:/takes/…/towel.h5"
    assert clipped("short") == "short"
    assert clipped("two\nlines") == "two lines"
    assert [clipped_list(each, most=4) for each in ("abcdef", "ab", [])] == ["a, b, c, d and 2 more", "a, b", ""]
    assert [short(v) for v in (0.03141, -0.0, 2849.3, 999.6, 12e6)] == ["0.0314", "0", "2849", "1000", "1.2e+07"]
    assert span(np.array([-0.31, 0.42]), "V") == "-0.31 to 0.42 V"
    assert span(np.ones(3)) == "1"
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
    assert frames_and_duration(1, 4.0) == "1 frame at 4 Hz, 0.25 s"


def test_data_are_pickled_and_copied():
    for name, noun in ORDINARY.items():
        assert repr(pickle.loads(pickle.dumps(noun))) == repr(deepcopy(noun)) == repr(noun), name
