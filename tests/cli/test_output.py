import json

import numpy as np
import pytest

from midair.cli.output import as_recording, may_write, print_written, reserved
from midair.errors import DeviceStateError, InputError
from midair.files import FormatLoss, load, load_pressure, save
from midair.model import PressureFrames, Provenance, SensorGrid

PRESSURE = PressureFrames(
    pressure=np.arange(12.0).reshape(3, 2, 2),
    rate=500.0,
    sensor=SensorGrid(rows=2, columns=2),
    provenance=Provenance(simulated=True, source="t"),
)


def test_pressure_as_a_recording_in_pa():
    recording = as_recording(PRESSURE)
    assert (recording.unit, recording.rate, recording.sensor) == ("Pa", 500.0, PRESSURE.sensor)
    assert recording.provenance == PRESSURE.provenance
    np.testing.assert_array_equal(recording.samples, PRESSURE.pressure)


def test_a_second_program_is_refused_before_its_work(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    with (
        reserved(tmp_path / "a.drive.h5"),
        reserved(tmp_path / "b.drive.h5"),
        pytest.raises(DeviceStateError, match=r"another program computes this file; wait for it"),
        reserved(tmp_path / "a.drive.h5"),
    ):
        pass
    with reserved(tmp_path / "a.drive.h5"):
        pass
    assert list((tmp_path / "state").iterdir()) == []


def test_midair_s_own_file_keeps_the_pressure(tmp_path):
    assert save(as_recording(PRESSURE), tmp_path / "A.H5", calibration=None, pressure=PRESSURE) == ()
    np.testing.assert_array_equal(load_pressure(tmp_path / "A.H5").pressure, PRESSURE.pressure)


def test_format_losses_are_printed(tmp_path):
    lost = save(as_recording(PRESSURE), tmp_path / "a.npz", calibration=None, pressure=PRESSURE)
    assert [one.what for one in lost] == ["pressure"]
    np.testing.assert_array_equal(load(tmp_path / "a.npz").samples, PRESSURE.pressure)
    assert save(as_recording(PRESSURE), tmp_path / "b.npz", calibration=None) == ()


def test_json_contains_what_is_printed(capsys):
    told = ([("frames", "3 at 1 Hz")], {"frames": 3}, ["cut"], [FormatLoss(what="rate", text="No rate.")])
    print_written(*told, simulated=True, json=True)
    assert json.loads(capsys.readouterr().out) == {
        "frames": 3,
        "simulated": True,
        "notes": ["cut"],
        "lost": [{"what": "rate", "text": "No rate."}],
    }
    print_written(*told, simulated=True, json=False)
    said = capsys.readouterr()
    words = said.out + said.err
    assert all(word in words for word in ("SIMULATED", "frames", "note: cut", "lost: No rate."))
    print_written(*told, simulated=False, json=False)
    assert "SIMULATED" not in "".join(capsys.readouterr())


def test_nothing_is_overwritten_without_force(tmp_path):
    (tmp_path / "a").touch()
    may_write(tmp_path / "b", force=False)
    may_write(tmp_path / "a", force=True)
    with pytest.raises(InputError, match="--force"):
        may_write(tmp_path / "a", force=False)
