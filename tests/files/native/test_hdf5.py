from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from midair.errors import BrokenFileError, InputError, UnknownFormatError
from midair.files import (
    load,
    load_calibration,
    load_prediction,
    load_solution,
    save,
    save_calibration,
    save_solution,
    store_prediction,
)
from midair.files.native.schema import TABLE
from midair.model import PressureFrames, Recording, SensorGrid


def test_xarray_opens_a_recording_and_its_pressure_with_axes_and_units(path, recording):
    with xarray.open_dataset(path, engine="h5netcdf") as table:
        assert table.samples.dims == ("time", "row", "column")
        assert table.samples.attrs["units"] == "Pa"
        assert table.time.attrs["units"] == "s"
        assert table.time.dtype == np.float64
        assert set(table.coords) == {"time", "row", "column", "x", "y"}
        np.testing.assert_array_equal(table.samples, recording.samples)
        np.testing.assert_array_equal(table.time, recording.time)
        np.testing.assert_array_equal(table.samples.x, recording.sensor.x)
        assert table.attrs["kind"] == "midair recording"
        assert table.attrs["sensor_name"] == "palm µ"
    pressure = PressureFrames(pressure=recording.samples * 2, rate=500, sensor=recording.sensor)
    save(recording, path, pressure=pressure)
    with xarray.open_dataset(path, engine="h5netcdf", group="pressure") as table:
        np.testing.assert_array_equal(table.pressure, recording.samples * 2)
        assert table.pressure.attrs["units"] == "Pa"


@pytest.mark.parametrize("locking", [None, False])
def test_a_recording_opens_while_this_program_has_it_open_in_xarray(path, recording, locking):
    how = {} if locking is None else {"driver_kwds": {"locking": locking}}
    with xarray.open_dataset(path, engine="h5netcdf", **how):
        np.testing.assert_array_equal(load(path).samples, recording.samples)


def test_xarray_opens_a_drive(solution, target, tmp_path):
    save_solution(solution, tmp_path / "a.drive.h5", target=target)
    with xarray.open_dataset(tmp_path / "a.drive.h5", engine="h5netcdf") as table:
        assert table.phase_step.dims == ("transducer", "time")
        assert table.target.attrs["units"] == "Pa"
        assert table.status.attrs["flag_meanings"] == "converged iterations stalled silent"
        np.testing.assert_array_equal(table.phase_step.T / (256 / (2 * np.pi)), solution.drive.phase)


def edit(path, act):
    with h5py.File(path, "r+") as file:
        act(file)


def replace(name, value):
    def act(file):
        units = file[name].attrs["units"]
        del file[name]
        file[name] = value
        file[name].attrs["units"] = units

    return act


def replace_by_group(file):
    del file["samples"]
    file.create_group("samples")


EDITS = {
    "kind of another program": (
        lambda f: f.attrs.__setitem__("kind", "speech"),
        "expected a midair recording, got speech",
    ),
    "no kind": (lambda f: f.attrs.__delitem__("kind"), "another program"),
    "format is text": (lambda f: f.attrs.__setitem__("format", "one"), "whole number"),
    "no unit": (lambda f: f.attrs.__delitem__("unit"), "expected unit in a midair recording"),
    "no samples": (lambda f: f.__delitem__("samples"), "expected samples"),
    "rate is text": (lambda f: f.attrs.__setitem__("rate_hz", "fast"), "rate_hz to be finite f8"),
    "rate is not finite": (lambda f: f.attrs.__setitem__("rate_hz", np.inf), "rate_hz to be finite f8"),
    "rate was edited": (lambda f: f.attrs.__setitem__("rate_hz", 100.0), "expected frame i at i / 100 Hz"),
    "a time was edited": (lambda f: f["time"].__setitem__(3, 0.5), "got frame 3 at 0.5 s"),
    "samples of another type": (replace("samples", np.zeros((40, 3, 5), "i4")), "expected f8"),
    "samples without rows": (replace("samples", np.zeros((40, 15))), "axes"),
    "samples of another length": (replace("samples", np.zeros((39, 3, 5))), "samples: expected 40 along time, got 39"),
    "samples in another unit": (lambda f: f["samples"].attrs.__setitem__("units", "V"), "got 'V' as unit"),
    "samples are a group": (replace_by_group, "expected a dataset samples"),
    "provenance without notes": (lambda f: f.attrs.__setitem__("provenance", "{}"), "expected source, got none"),
    "provenance is no JSON": (lambda f: f.attrs.__setitem__("provenance", "{"), "JSON"),
}


def test_refuses_what_differs_from_the_table(path, subtests):
    whole = path.read_bytes()
    for name, (act, message) in EDITS.items():
        path.write_bytes(whole)
        edit(path, act)
        with subtests.test(name=name), pytest.raises(BrokenFileError, match=message) as caught:
            load(path)
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["recording", "drive", "calibration"])
def test_a_flipped_bit_is_one_clear_error(name, path, solution, tmp_path):
    if name == "drive":
        path = tmp_path / "a.drive.h5"
        save_solution(solution, path)
    dataset, read = {
        "recording": ("/samples", load),
        "drive": ("/phase_step", load_solution),
        "calibration": ("/calibration/response_imag", load_calibration),
    }[name]
    with h5py.File(path) as file:
        place = file[dataset].id.get_chunk_info(0).byte_offset + 7
    data = bytearray(path.read_bytes())
    data[place] ^= 64
    path.write_bytes(data)
    with pytest.raises(BrokenFileError) as caught:
        read(path)
    assert str(caught.value) == f"{path}: {dataset}: damaged, its checksum does not match; use a copy"


def test_refuses_a_newer_format_and_an_impossible_unit(path):
    def act(file):
        file.attrs["unit"] = "N"
        file["samples"].attrs["units"] = "N"

    edit(path, act)
    with pytest.raises(InputError, match="unit of the samples"):
        load(path)
    edit(path, lambda file: file.attrs.__setitem__("format", 2))
    with pytest.raises(UnknownFormatError, match="update midair"):
        load(path)


@pytest.mark.parametrize("name", ["nul\0l", "\ud800"])
def test_refuses_text_that_a_file_would_change(name, tmp_path):
    recording = Recording(samples=np.zeros((2, 4, 4)), rate=1000, sensor=SensorGrid(name=name))
    with pytest.raises(InputError, match="expected text"):
        save(recording, tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


REFERENCE = Path(__file__).parents[3] / "docs" / "reference.py"


@pytest.mark.long
def test_files_hold_exactly_what_the_table_says(recording, calibration, solution, target, tmp_path):
    pressure = PressureFrames(pressure=recording.samples, rate=333, sensor=recording.sensor, band=(20, 160))
    save(recording, tmp_path / "a.h5", calibration=calibration, pressure=pressure)
    save_calibration(calibration, tmp_path / "a.calibration.h5")
    save_solution(solution, tmp_path / "a.drive.h5", target=target)
    store_prediction(tmp_path / "a.drive.h5", {"felt": 8})
    assert load_prediction(tmp_path / "a.drive.h5") == {"felt": 8}
    for text in ("[8]", "{"):
        edit(tmp_path / "a.drive.h5", lambda file, text=text: file.attrs.__setitem__("predicted", text))
        with pytest.raises(BrokenFileError, match=r"a\.drive\.h5"):
            load_prediction(tmp_path / "a.drive.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        journal = {entry.name for entry in TABLE["recording"] if entry.name.startswith(("event", "stage"))}
        check(file, "recording", extra={"calibration", "pressure"}, without=journal)
        check(file["calibration"], "calibration")
        check(file["pressure"], "pressure")
    with h5py.File(tmp_path / "a.calibration.h5") as file:
        check(file, "calibration")
    with h5py.File(tmp_path / "a.drive.h5") as file:
        check(file, "drive", without={"phase", "transducer_level", "level_step", "response_real", "response_imag"})


def check(group, kind, *, extra=frozenset(), without=frozenset()):
    entries = [entry for entry in TABLE[kind] if entry.name not in without]
    assert set(group.attrs) == {entry.name for entry in entries if entry.dimensions is None}
    assert set(group) - extra == {entry.name for entry in entries if entry.dimensions is not None}
    for entry in entries:
        if entry.dimensions is not None:
            assert group[entry.name].dtype == ("f4" if entry.packed and entry.single else np.dtype(entry.dtype))
            assert group[entry.name].ndim == len(entry.dimensions)
