from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from tests.model.test_calibration import calibration

from midair.errors import InputError
from midair.files import save_array_calibration
from midair.model import (
    AmplitudeFrames,
    ControlGrid,
    Medium,
    Provenance,
    TransducerArray,
)
from midair.rig import keep_array_calibration, keep_array_check, kept_array_calibration, open_rig
from midair.rig.names.array_names import array_named, calibration_age
from midair.settings import best_mode
from midair.solvers import solve

ARRAY = TransducerArray.autd3()


def test_names_of_arrays(subtests):
    for name, simulated in [
        ("autd3", False),
        ("autd3:emulator", True),
        ("autd3-simulator:5000", True),
        ("autd3-server", False),
        ("pyautd3", False),
        ("pyautd3:eth0", False),
        ("pyautd3:twincat", False),
        ("pyautd3:remote:127.0.0.1:8080", False),
        ("pyautd3:audit", True),
        ("pyautd3:nop", True),
    ]:
        with subtests.test(name=name):
            array = array_named(name)
            assert array.simulated is simulated
            assert array.gated
            assert array.array.same_as(ARRAY)


STORED = TransducerArray.autd3(columns=1, rows=1)


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))


def known(*, simulated=False, day="2026-11-20"):
    measured = {"temperature_c": 22.0, "height_m": 0.2}
    life = Provenance(source="bench", simulated=simulated).then("measure array", measured)
    return calibration(STORED, response=np.ones(STORED.count), date=day, provenance=life)


def test_each_address_has_its_own_calibration_and_the_virtual_array_none():
    first, second = known(), replace(known(), response=np.full(STORED.count, 0.5 + 0j))
    keep_array_calibration("autd3:eth0", first)
    keep_array_calibration("pyautd3:eth0?x=1", second)
    assert kept_array_calibration("autd3:eth0").known.identifier == first.identifier
    # The option does not change which array it is.
    assert kept_array_calibration("pyautd3:eth0").known.identifier == second.identifier
    assert kept_array_calibration("autd3:eth1") is None
    assert kept_array_calibration("virtual") is None
    with pytest.raises(InputError, match="a real array, got a simulated one"):
        keep_array_calibration("autd3:emulator", known(simulated=True))
    with pytest.raises(InputError, match="a real array"):
        keep_array_calibration("virtual", first)


def test_a_check_is_kept_until_the_array_is_measured_again():
    keep_array_check("autd3", "holds")
    assert kept_array_calibration("autd3") is None
    keep_array_calibration("autd3", known())
    keep_array_check("autd3", "unit 1 is late")
    assert kept_array_calibration("autd3").checked.endswith(": unit 1 is late")
    assert "not checked" not in kept_array_calibration("autd3").described(best_mode())
    keep_array_calibration("autd3", known())
    assert kept_array_calibration("autd3").checked == ""
    assert "not checked today: midair calibrate array SENSOR --device autd3 --check" in kept_array_calibration(
        "autd3"
    ).described(best_mode())


def test_age_and_what_changed_are_said(subtests):
    for day, temperature, height, said in [
        ("2026-11-20", 22.4, 0.21, "3 days old"),
        ("2026-11-22T10:00", 22.0, 0.2, "1 day old"),
        ("", 25.0, 0.2, "of unknown age, measured at 22 °C, this air has 25 °C"),
        ("2026-11-20", 22.0, 0.15, "3 days old, measured at a height of 200 mm, the palm is at 150 mm"),
    ]:
        with subtests.test(day=day):
            medium = Medium.at(temperature=temperature)
            assert calibration_age(known(day=day), today=date(2026, 11, 23), medium=medium, height=height) == said


def test_a_rig_and_every_solve_for_it_take_the_stored_calibration(tmp_path):
    """A drive that was solved from Python names the calibration too."""
    whole = TransducerArray.autd3()
    stored = calibration(whole)
    keep_array_calibration("autd3:emulator", stored)
    rig = open_rig("autd3:emulator")
    np.testing.assert_array_equal(rig.transducers.response, stored.response)
    assert f"({stored.identifier}), of unknown age" in repr(rig)
    grid = ControlGrid(rows=2, columns=2, pitch=11e-3)
    target = AmplitudeFrames(amplitude=np.ones((1, 4)), rate=1000.0, grid=grid)
    drive = solve(target, rig.transducers, method="fast").drive
    assert drive.provenance.last("solve")["array_calibration"] == stored.identifier
    assert "array_calibration" not in solve(target, whole, method="fast").drive.provenance.last("solve")
    save_array_calibration(replace(stored, response=np.full(whole.count, 0.5)), tmp_path / "other.array.h5")
    assert open_rig("autd3:emulator", array_calibration=tmp_path / "other.array.h5").transducers.response[0] == 0.5
    for device, given in (("autd3:emulator", "none"), ("autd3", None), ("virtual", None), ("virtual", "none")):
        assert open_rig(device, array_calibration=given).transducers.alike
