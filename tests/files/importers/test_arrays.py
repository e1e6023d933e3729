from itertools import product

import h5py
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from midair.errors import BrokenFileError, InputError, MismatchError, NonFiniteError, ShapeError
from midair.files import load, open_take, save
from midair.model import SensorGrid

RNG = np.random.default_rng(0)


SAID = {"rate": 1000.0, "unit": "V"}


def test_reads_mat_of_version_73(tmp_path):
    """MATLAB writes v7.3 as HDF5 behind 512 bytes of its own, with the axes in reverse."""
    data = np.random.default_rng(0).normal(size=(6, 2, 3))
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["x"] = data.T
    with (tmp_path / "a.mat").open("rb+") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    seen = open_take(tmp_path / "a.mat", **SAID)
    np.testing.assert_array_equal(seen.recording.samples, data)
    assert seen.recording.provenance.steps[0].settings["format"] == "MAT v7.3"


@pytest.mark.parametrize("start", [b"not a MATLAB file", b"\x01\x02\x03\x04" * 40], ids=["text", "bytes"])
def test_scipy_never_reads_other_files(start, tmp_path):
    (tmp_path / "a.mat").write_bytes(start)
    with pytest.raises(BrokenFileError, match="expected a MATLAB file, got one that begins with"):
        load(tmp_path / "a.mat", **SAID)


def write(path, arrays):
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        savemat(path, arrays)
    return path


each = pytest.mark.parametrize("ending", [".npz", ".mat"])


@each
def test_other_programs_read_samples_rate_and_unit(ending, recording, tmp_path):
    path = tmp_path / f"a{ending}"
    save(recording, path)
    arrays = np.load(path) if ending == ".npz" else loadmat(path)
    np.testing.assert_array_equal(arrays["samples"], recording.samples)
    assert arrays["rate"].item() == recording.rate
    assert arrays["unit"].item() == "Pa"


@each
def test_reads_the_one_array_or_the_named_one(ending, tmp_path):
    data = np.random.default_rng(0).normal(size=(5, 2, 3))
    seen = open_take(write(tmp_path / f"a{ending}", {"data": data, "scale": 3.0}), **SAID)
    np.testing.assert_array_equal(seen.recording.samples, data)
    assert seen.recording.sensor == SensorGrid(rows=2, columns=3)
    assert "pitch" in seen.report[0]
    path = write(tmp_path / f"b{ending}", {"samples": data, "noise": 0 * data})
    np.testing.assert_array_equal(load(path, **SAID).samples, data)
    path = write(tmp_path / f"c{ending}", {"a": np.ones((3, 4)), "b": np.zeros((3, 4))})
    assert load(path, **SAID, field="b", channels=["1"]).samples.max() == 0
    with pytest.raises(MismatchError, match="called 'c'"):
        load(path, **SAID, field="c")


@each
def test_refuses_ambiguous_arrays(ending, tmp_path):
    two = {"a": np.ones((3, 4)), "b": np.ones((3, 4))}
    for arrays in (two, {"a": np.array("text")}, {"a": np.ones((2, 2), complex)}):
        with pytest.raises(BrokenFileError, match="expected one array of numbers"):
            load(write(tmp_path / f"a{ending}", arrays), **SAID)


TONE = np.sin(2 * np.pi * 100 * np.arange(60)[:, None] / 1000) * np.linspace(0.5, 1, 16)


@each
@pytest.mark.parametrize(
    "facts",
    [
        {"fs": 1e3},
        {"Fs": 1e3, "unit": "mV"},
        {"srate": 1000},
        {"sampling_rate": 1e3, "t": np.arange(60) / 1e3},
        {"time_ms": np.arange(60)},
    ],
)
def test_rate_stamps_and_unit_beside_the_array_count(ending, facts, tmp_path):
    for data in (TONE, TONE.T):
        path = write(tmp_path / f"a{ending}", {"data": data, "label": "towel", **facts})
        said = {} if "unit" in facts else {"unit": "V"}
        recording = load(path, **said)
        assert recording.rate == pytest.approx(1000, rel=1e-6)
        np.testing.assert_allclose(recording.samples.reshape(60, 16), TONE * (1 if said else 1e-3), atol=1e-12)
        with pytest.raises(InputError, match=r"250 Hz; (leave|correct)"):
            load(path, **said, rate=250.0)
    with pytest.raises(MismatchError, match="expected one rate, got 500 Hz, 1000 Hz"):
        load(write(path, {"data": TONE, "fs": 1e3, "rate": 500}), unit="V")


def test_the_axis_of_time_follows_from_layout_or_length(tmp_path, subtests):
    for shape, sensor, turned in [
        ((20, 6), SensorGrid(rows=2, columns=3), False),
        ((6, 20), SensorGrid(rows=2, columns=3), True),
        ((4, 6), SensorGrid(rows=2, columns=3), False),
        ((20, 2, 3), SensorGrid(rows=2, columns=3), False),
        ((2, 3, 20), SensorGrid(rows=2, columns=3), True),
        ((16, 40), None, True),
        ((3, 16), None, False),
    ]:
        with subtests.test(shape=shape):
            data = np.random.default_rng(0).normal(size=shape)
            np.save(tmp_path / "a.npy", data)
            taken = open_take(tmp_path / "a.npy", **SAID, sensor=sensor)
            frames = np.moveaxis(data, -1, 0) if turned else data
            np.testing.assert_array_equal(taken.recording.samples.reshape(frames.shape), frames)
            assert ("was turned: its last axis is time" in " ".join(taken.report)) == turned


def test_a_square_array_needs_an_option(tmp_path):
    data = np.random.default_rng(0).normal(size=(6, 6))
    np.save(tmp_path / "a.npy", data)
    with pytest.raises(ShapeError, match=r"got a \(6, 6\), whose first or last may be time; give transpose=True"):
        load(tmp_path / "a.npy", **SAID)
    recording = load(tmp_path / "a.npy", **SAID, transpose=True, channels=["1"])
    np.testing.assert_array_equal(recording.samples.ravel(), data[1])


def test_fields_of_structs_and_cells_have_paths(tmp_path):
    trials = np.empty(2, object)
    trials[:] = [TONE[:20], TONE[20:]]
    struct_of = {"S": {"data": TONE, "fs": 1e3, "inner": {"data": TONE.T}}, "fs": 500.0, "trials": trials}
    savemat(tmp_path / "a.mat", struct_of)
    assert load(tmp_path / "a.mat", unit="V", field="S.data").rate == 1000
    assert load(tmp_path / "a.mat", unit="V", field="trials.1").frames == 40
    assert load(tmp_path / "a.mat", unit="V", field="S.inner.data").frames == 60
    with pytest.raises(BrokenFileError, match=r"its name as field, got S.data \(60, 16\), S.fs \(\), S.inner.data"):
        load(tmp_path / "a.mat", unit="V")
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file["S/data"], file["S/fs"] = TONE.T, [[1e3]]
    with (tmp_path / "b.mat").open("rb+") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    np.testing.assert_array_equal(load(tmp_path / "b.mat", unit="V").samples.reshape(60, 16), TONE)


def test_reads_arrays_saved_by_numpy(tmp_path):
    for order, kind, shape in product("CF", ["f8", ">f4", "i2"], [(5, 16), (5, 4, 4)]):
        samples = np.arange(80).reshape(shape).astype(kind, order=order)
        np.save(tmp_path / "a.npy", samples)
        np.testing.assert_array_equal(load(tmp_path / "a.npy", **SAID).samples, samples.reshape(5, 4, 4))


def test_loads_no_objects(tmp_path):
    objects = np.array([[{}], [{}]], object)
    np.save(tmp_path / "a.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "a.npz", samples=objects)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(BrokenFileError, match=name[2:].upper()):
            load(tmp_path / name, **SAID)


def test_a_header_larger_than_the_file_allocates_no_memory(tmp_path):
    with (tmp_path / "a.npy").open("wb") as file:
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 16)}
        np.lib.format.write_array_header_1_0(file, header)
        file.write(bytes(800))
    with pytest.raises(BrokenFileError, match="length is greater than file size"):
        load(tmp_path / "a.npy", **SAID)


def test_truncated_files_and_non_finite_numbers_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.full((5, 16), np.nan))
    with pytest.raises(NonFiniteError, match="midair import --mend"):
        load(tmp_path / "a.npy", **SAID)
    data = (tmp_path / "a.npy").read_bytes()
    for kept in (3, 40, 200, len(data) - 1):
        (tmp_path / "b.npy").write_bytes(data[:kept])
        with pytest.raises(BrokenFileError):
            load(tmp_path / "b.npy", **SAID)


def test_times_of_numpy_are_stamps(tmp_path):
    """They were "a damaged or foreign file"."""
    times = np.datetime64("2026-01-01") + (1000 * np.arange(400)).astype("timedelta64[us]")
    np.savez(tmp_path / "a.npz", time=times, x=np.arange(400.0))
    assert load(tmp_path / "a.npz", unit="V").rate == 1000
