import dataclasses

import pytest

from midair.model import Provenance, Step


def test_a_step_is_added_and_the_past_kept():
    before = Provenance(source="virtual:towel", notes={"object": "towel"})
    after = before.then("calibrate", {"band_hz": (20.0, 470.0)}).then("prepare", {"mapping": "half-wave"})
    assert [step.stage for step in after.steps] == ["calibrate", "prepare"]
    assert after.steps[0].settings["band_hz"] == (20.0, 470.0)
    assert (after.source, after.notes) == (before.source, before.notes)
    assert before.steps == ()


def test_what_was_simulated_once_stays_so():
    assert Provenance(simulated=True).then("solve", {}).simulated
    assert Provenance().then("play", {}, simulated=True).then("compare", {}).simulated
    assert not Provenance().then("solve", {}).simulated


def test_nothing_of_it_can_be_changed():
    settings = {"taps": 201}
    step = Step(stage="calibrate", settings=settings)
    settings["taps"] = 0
    assert step.settings["taps"] == 201
    with pytest.raises(TypeError):
        step.settings["taps"] = 1
    with pytest.raises(TypeError):
        Provenance(notes={"a": "b"}).notes["a"] = "c"
    with pytest.raises(dataclasses.FrozenInstanceError):
        Provenance().source = "elsewhere"


def test_the_last_step_of_a_name_tells():
    life = Provenance().then("cut", {"start_s": 1.0}).then("lead", {}).then("cut", {"start_s": 2.0})
    assert life.last("cut")["start_s"] == 2.0
    assert dict(life.last("play")) == {}
