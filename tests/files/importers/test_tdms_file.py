"""TDMS: segments written here after National Instruments' description."""

import numpy as np
import pytest
from tests.foreign_files import daqmx, tdms

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files import load, open_take
from midair.model import SensorGrid

PAIR = SensorGrid(rows=1, columns=2)


@pytest.fixture
def file(tmp_path):
    def write(data):
        (tmp_path / "a.tdms").write_bytes(data)
        return tmp_path / "a.tdms"

    return write


@pytest.fixture
def columns():
    rng = np.random.default_rng(2)
    return {"a": rng.normal(size=60), "it's b": rng.normal(size=60).astype("f4")}


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("chunks", [1, 3])
def test_reads_every_layout(order, interleaved, chunks, columns, file):
    seen = open_take(file(tdms(columns, order=order, interleaved=interleaved, chunks=chunks)), sensor=PAIR)
    for i, name in enumerate(columns):
        np.testing.assert_array_equal(seen.recording.samples[:, 0, i], columns[name])
    assert seen.recording.rate == 1000
    assert seen.recording.unit == "V"
    assert seen.recording.provenance.notes["group"] == "skin"
    assert seen.report == ()


def test_later_segments_without_metadata_go_on(columns, file):
    more = {name: column + 1 for name, column in columns.items()}
    recording = load(file(tdms(columns) + tdms(more, meta=False)), sensor=PAIR)
    assert recording.frames == 120
    np.testing.assert_array_equal(recording.samples[60:, 0, 0], columns["a"] + 1)
    data = tdms(columns, chunks=6)
    unfinished = data[:12] + b"\xff" * 8 + data[20:-5]
    seen = open_take(file(unfinished), sensor=PAIR)
    assert seen.recording.frames == 50
    assert seen.report == ("The file was not closed: complete records were read.",)


def test_whole_numbers_stay_whole_and_the_stated_unit_and_rate_count(columns, file):
    for dtype in ("i2", "i4", "u1", "f4"):
        data = np.array([1, 2, 250 if dtype == "u1" else -3], dtype)
        assert load(file(tdms({"x": data}, said={})), rate=50, unit="count").samples.ravel().tolist() == data.tolist()
    recording = load(file(tdms(columns, said={"unit_string": "mV"})), rate=48000, sensor=PAIR)
    assert (recording.rate, recording.samples[0, 0, 0]) == (48000, columns["a"][0] * 1e-3)


def test_several_groups_need_a_name(columns, file):
    path = file(tdms(columns) + tdms(columns, group="arm"))
    with pytest.raises(BrokenFileError, match=r"skin \(2 channels\), arm \(2 channels\)"):
        load(path, sensor=PAIR)
    assert load(path, sensor=PAIR, field="arm").frames == 60
    with pytest.raises(MismatchError, match="expected a group 'leg'"):
        load(path, field="leg")


SCALES = {
    "wf_increment": 1e-3,
    "unit_string": "Volts",
    "NI_Scaling_Status": "unscaled",
    "NI_Number_Of_Scales": 3,
    "NI_Scale[1]_Scale_Type": "Linear",
    "NI_Scale[1]_Linear_Slope": 0.5,
    "NI_Scale[1]_Linear_Y_Intercept": -1.0,
    "NI_Scale[1]_Linear_Input_Source": 0,
    "NI_Scale[2]_Scale_Type": "Polynomial",
    "NI_Scale[2]_Polynomial_Coefficients_Size": 3,
    "NI_Scale[2]_Polynomial_Coefficients[0]": 1.0,
    "NI_Scale[2]_Polynomial_Coefficients[1]": 2e-3,
    "NI_Scale[2]_Polynomial_Coefficients[2]": 1e-7,
    "NI_Scale[2]_Polynomial_Input_Source": 1,
}


@pytest.fixture
def logged(file):
    """Two channels and two chunks as NI-DAQmx logs them, rows of int16 between bytes of others, and their volts."""
    rows = np.random.default_rng(3).integers(-30_000, 30_000, (40, 4)).astype("<i2")
    volts = np.polynomial.polynomial.polyval(0.5 * rows[:, [1, 3]] - 1, [1, 2e-3, 1e-7])
    return file(daqmx(rows.tobytes(), {"ai0": 2, "ai1": 6}, SCALES, frames=20, width=8)), volts


def test_reads_what_daqmx_logs_as_an_outside_reader_does(logged):
    path, volts = logged
    recording = load(path, sensor=PAIR)
    assert (recording.rate, recording.unit) == (1000, "V")
    np.testing.assert_allclose(recording.samples[:, 0], volts, rtol=1e-12)
    channels = pytest.importorskip("nptdms").TdmsFile.read(path)["skin"].channels()
    np.testing.assert_allclose(np.stack([each[:] for each in channels], axis=1), volts, rtol=1e-12)


def test_refuses_data_that_it_would_misread(columns, file):
    table = {"wf_increment": 1.0, "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "RTD"}
    with pytest.raises(UnknownFormatError, match="scale RTD, which is not read"):
        load(file(tdms(columns, said=table)), sensor=PAIR)
    digital = daqmx(bytes(40), {"a": 0}, {}, frames=20, width=2).replace(b"\x69\x12", b"\x69\x13")
    with pytest.raises(UnknownFormatError, match="digital lines"):
        load(file(digital), sensor=PAIR)
    circular = SCALES | {"NI_Scale[1]_Linear_Input_Source": 2}
    with pytest.raises(BrokenFileError, match="expected a scale before 1 as its input, got 2"):
        load(file(daqmx(bytes(40), {"a": 0}, circular, frames=20, width=2)))
    with pytest.raises(BrokenFileError, match="channels of one length in group 'skin', got a 60, b 50"):
        load(file(tdms({"a": columns["a"]}) + tdms({"b": columns["a"][:50]})), sensor=PAIR)
