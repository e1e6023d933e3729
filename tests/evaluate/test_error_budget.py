import json
from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import Leak, StageOutput, budget
from midair.model import PressureFrames, Provenance

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
    outputs = [
        StageOutput(name="first", what="adds a tenth", pressure=first),
        StageOutput(
            name="second",
            what="adds another",
            pressure=second,
            leak=Leak(peak=0.5, typical=0.2, place=(0.0, 0.0), wanted=10.0),
        ),
    ]
    return budget(original, outputs, strength=0.1, kept=0.9)


def test_alone_and_so_far_by_hand(made):
    assert made.stage("first").so_far.distortion_ratio == pytest.approx(20, abs=0.05)
    assert made.stage("first").alone == made.stage("first").so_far
    # alone: .1 more in 1 + .01 of power; cumulative: twice .01
    assert made.stage("second").alone.distortion_ratio == pytest.approx(10 * np.log10(101), abs=0.1)
    assert made.stage("second").so_far.distortion_ratio == pytest.approx(10 * np.log10(50), abs=0.05)


def test_simulated_once_is_simulated(made):
    assert made.simulated
    assert not budget(frames((100, 1)), [], strength=0.1).simulated


def test_json_has_every_stage_and_no_infinity(made):
    perfect = budget(frames((100, 1)), [StageOutput(name="none", what="", pressure=frames((100, 1)))], strength=0.1)
    plain = made.plain()
    assert [stage["stage"] for stage in plain["stages"]] == ["first", "second"]
    assert plain["stages"][1]["leak"] == 0.5
    assert plain["kept_in_band"] == 0.9
    assert "Infinity" not in json.dumps(plain) + json.dumps(perfect.plain())
    assert replace(made, kept=None).plain()["kept_in_band"] is None
