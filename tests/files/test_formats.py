"""One contract for all recording formats and the functions that read and write them."""

import io
import tracemalloc
import zipfile
from copy import copy
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from midair import __version__, files
from midair.errors import (
    BrokenFileError,
    InputError,
    MismatchError,
    MissingFileError,
    NonFiniteError,
    UnknownFormatError,
)
from midair.files import (
    FORMATS,
    check_memory_for,
    contents,
    load,
    load_calibration,
    open_take,
    save,
    save_solution,
)
from midair.files.size_limits import EXPANDED_ANYWAY
from midair.model import Calibration, Event, PressureFrames, Provenance, Recording, SensorGrid
from midair.recordings import cut

ROUNDED = ".flac"
"""Has fewer bits and channels: tests/files/importers/test_sound_file.py."""
BOTH = [".h5", ".hdf5"]
IN = [ending for ending, form in FORMATS.items() if ending not in (".ahap", ".haptic")]
OUT = [ending for ending, form in FORMATS.items() if form.write and ending != ROUNDED]

each_writer = pytest.mark.parametrize("ending", OUT)


numbers = st.floats(-1e9, 1e9, allow_subnormal=False).filter(lambda x: x == 0 or abs(x) > 1e-9)
leaves = st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=8)
setting = st.recursive(leaves, lambda part: st.lists(part, max_size=3).map(tuple), max_leaves=6)
names = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    shape = draw(st.tuples(st.integers(1, 6), st.integers(1, 4), st.integers(1, 4)))
    life = Provenance(
        source=draw(st.text(max_size=12)),
        simulated=draw(st.booleans()),
        notes=draw(st.dictionaries(st.text(max_size=6), st.text(max_size=6), max_size=2)),
    )
    return Recording(
        samples=draw(arrays.arrays(np.float64, shape, elements=numbers)),
        rate=draw(st.floats(1e-3, 1e6)),
        sensor=SensorGrid(rows=shape[1], columns=shape[2], pitch=draw(st.floats(1e-6, 0.2)), name=draw(names)),
        unit=draw(st.sampled_from(["V", "count", "Pa"])),
        provenance=life.then(
            draw(st.text(max_size=6)), draw(st.dictionaries(st.text(max_size=6), setting, max_size=3))
        ),
    )


@pytest.mark.long
@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(recording=recordings())
def test_returns_the_saved_recording(recording, tmp_path, alike):
    path = tmp_path / "towel.h5"
    save(recording, path)
    alike(load(path), recording)


def test_refuses_what_is_no_file_of_its_kind(tmp_path, subtests):
    others = (b"\x89PNG\r\n\x1a\n\x00\x01", b"hello, world\n", b"\0" * 600, b"%PDF-1.7\n" * 90)
    for ending in IN:
        with subtests.test(ending=ending):
            path = tmp_path / f"towel{ending}"
            with pytest.raises(MissingFileError, match="no such file"):
                load(path)
            path.mkdir()
            with pytest.raises(BrokenFileError, match="folder"):
                load(path)
            path.rmdir()
            path.touch()
            with pytest.raises(BrokenFileError, match="empty"):
                load(path)
            for other in others:
                path.write_bytes(other)
                with pytest.raises(BrokenFileError):
                    load(path)


@pytest.mark.parametrize("ending", [ending for ending in OUT if ending != ".csv"])  # whose lines state no number
def test_refuses_a_file_that_was_cut(ending, recording, tmp_path):
    path = tmp_path / f"towel{ending}"
    save(recording, path)
    data = path.read_bytes()
    for kept in (0.02, 0.3, 0.7, 0.99):
        path.write_bytes(data[: int(kept * len(data))])
        with pytest.raises(BrokenFileError) as caught:
            load(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


@each_writer
def test_refuses_a_number_that_is_not_finite(ending, recording, tmp_path):
    samples = recording.samples.copy()
    samples[5, 1, 2] = np.nan
    object.__setattr__(spoilt := copy(recording), "samples", samples)
    path = tmp_path / f"towel{ending}"
    save(spoilt, path)
    with pytest.raises(NonFiniteError, match="nan") as caught:
        load(path, unit=recording.unit, sensor=recording.sensor)
    assert str(path) in str(caught.value)


def test_refuses_what_contradicts_the_file_and_takes_what_agrees(recording, tmp_path, alike):
    path = tmp_path / "towel.h5"
    save(recording, path)
    alike(load(path, rate=recording.rate, unit=recording.unit, sensor=recording.sensor), recording)
    wrong = {"rate": 50.0, "unit": "count", "sensor": SensorGrid(rows=5, columns=3), "scale": 2.0, "channels": ["0"]}
    for name, value in (wrong | {"field": "a"}).items():
        with pytest.raises(MismatchError, match="leave"):
            load(path, **{name: value})


@each_writer
@pytest.mark.parametrize("case", [str.lower, str.upper, str.title])
def test_every_ending_in_any_case_keeps_what_its_file_can_hold(ending, case, tmp_path):
    life = Provenance(source="virtual:towel", simulated=case is str.lower)
    samples = np.random.default_rng(1).normal(size=(40, 4, 4))
    recording, path = Recording(samples=samples, rate=1000, provenance=life), tmp_path / case(f"take{ending}")
    calibration = Calibration.flat(recording.sensor, sensitivity=0.02)
    lost = {loss.what for loss in save(recording, path, calibration=calibration)}
    sound = ending == ".wav"  # which holds parts of full scale, and no unit
    opened = open_take(path, **({"unit": "V"} if sound else {}))
    full = 2.0 ** np.ceil(np.log2(np.abs(samples).max())) if sound else 1.0
    np.testing.assert_array_equal(full * opened.recording.samples, samples)
    back = opened.recording
    assert (back.rate, back.unit, back.provenance.simulated) == (pytest.approx(1000), "V", case is str.lower)
    kept = ending in BOTH
    assert (opened.stored, opened.calibration is not None) == (kept, kept)
    assert {"provenance", "calibration"} & lost == (set() if kept else {"provenance", "calibration"})
    if kept:
        np.testing.assert_array_equal(opened.calibration.response, calibration.response)


@pytest.mark.parametrize(("name", "door"), [("a.drive.h5", "load_solution"), ("a.calibration.h5", "load_calibration")])
def test_names_the_right_function(name, door, recording, tmp_path):
    (tmp_path / name).write_text("some file")
    for act in (lambda: open_take(tmp_path / name), lambda: save(recording, tmp_path / name)):
        with pytest.raises(UnknownFormatError, match=door):
            act()


def test_float32_stays_float32_and_other_numbers_stay_as_they_are(tmp_path):
    import h5py
    import soundfile

    single = np.random.default_rng(0).standard_normal((3000, 16)).astype(np.float32)
    soundfile.write(tmp_path / "a.wav", single, 48_000, subtype="FLOAT")
    save(open_take(tmp_path / "a.wav", unit="V").recording, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["samples"].dtype == "<f4"
    np.testing.assert_array_equal(load(tmp_path / "a.h5").samples, single.reshape(-1, 4, 4))
    # A part of it, and a copy, are float32 too.
    save(cut(open_take(tmp_path / "a.h5").recording, 0.01, 0.02), tmp_path / "b.h5")
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["samples"].dtype == "<f4"
    save(Recording(samples=np.full((3, 4, 4), 0.1), rate=1000), tmp_path / "c.h5")
    with h5py.File(tmp_path / "c.h5") as file:
        assert file["samples"].dtype == "<f8"


def test_what_does_not_fit_is_refused_and_of_a_recording_the_length_that_would_is_told(
    recording, tmp_path, monkeypatch
):
    save(Recording(samples=np.zeros((1000, 4, 4)), rate=100.0), tmp_path / "a.h5")
    monkeypatch.setattr("midair.ram.available_memory", lambda: 1000 * 16 * 24 // 4)
    with pytest.raises(InputError, match=r"for 10 s at 100 Hz, got .* kB; 2\.5 s would fit: take a part"):
        load(tmp_path / "a.h5")
    monkeypatch.setattr("midair.ram.available_memory", lambda: 1000)
    for ending in [ending for ending, form in FORMATS.items() if form.memory]:
        (path := tmp_path / f"big{ending}").write_bytes(bytes(1000))
        with pytest.raises(InputError, match=r"B of free memory, because all of it is read at once, got 1\.0 kB; cut"):
            open_take(path)
    monkeypatch.setattr("midair.ram.available_memory", lambda: None)
    check_memory_for(1e18, "a.csv", "cut it")


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mat"])
def test_reading_takes_at_least_the_stated_memory(ending, tmp_path):
    samples = np.random.default_rng(0).normal(size=(3000, 4, 4))
    path = tmp_path / f"a{ending}"
    save(Recording(samples=samples, rate=1000.0), path)
    open_take(path)
    tracemalloc.start()
    open_take(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert FORMATS[ending].memory * path.stat().st_size <= peak


def test_saves_each_kind_of_data(recording, calibration, solution, tmp_path):
    pressure = PressureFrames(pressure=recording.samples, rate=recording.rate, sensor=recording.sensor)
    save(pressure, tmp_path / "p.h5")
    assert (load(tmp_path / "p.h5").unit, load(tmp_path / "p.h5").frames) == ("Pa", recording.frames)
    save(solution, tmp_path / "s.drive.h5")
    (tmp_path / "s.drive.h5").rename(tmp_path / "S.Drive.H5")
    np.testing.assert_array_equal(load(tmp_path / "S.Drive.H5").error, solution.error)
    with pytest.raises(InputError, match="expected no options for a drive, got rate=1000"):
        load(tmp_path / "S.Drive.H5", rate=1000.0)
    save(solution.drive, tmp_path / "d.drive.h5")
    assert np.isnan(load(tmp_path / "d.drive.h5").error).all()
    save(calibration, tmp_path / "c.calibration.h5")
    assert load_calibration(tmp_path / "c.calibration.h5").unit == calibration.unit
    save(solution, tmp_path / "phases.csv")
    table = np.genfromtxt(tmp_path / "phases.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["time_s"], np.arange(len(table)) / solution.drive.rate, atol=1e-6)
    np.testing.assert_allclose(table["phase_1"], solution.drive.phase[:, 1], atol=1e-6)
    solution.to_csv(tmp_path / "errors.csv")
    with pytest.raises(InputError, match="already exists; give another name"):
        solution.to_csv(tmp_path / "errors.csv")
    table = np.genfromtxt(tmp_path / "errors.csv", delimiter=",", names=True)
    wanted = np.column_stack([solution.drive.time, solution.error, solution.iterations, solution.plays])
    np.testing.assert_allclose(table[["time_s", "E", "iterations", "plays"]].tolist(), wanted, rtol=1e-5, atol=1e-6)


def test_saving_over_a_file_loses_nothing_that_it_holds(recording, calibration, solution, target, tmp_path):
    path, drive = tmp_path / "a.h5", tmp_path / "a.drive.h5"
    life = recording.provenance.then("calibrate", {"band": (20.0, 470.0)})
    how = {"sensor": recording.sensor, "band": (20.0, 470.0), "provenance": life}
    pressure = PressureFrames(pressure=recording.samples[:7], rate=250, **how)
    save(recording, path, calibration=calibration, pressure=pressure, journal=[Event(kind="trigger", frame=3)])
    for _ in range(2):
        save(load(path), path)
    take, other = open_take(path), replace(recording, samples=recording.samples + 1)
    assert (take.calibration.identifier, take.journal[0].frame) == (calibration.identifier, 3)
    assert [step.stage for step in take.recording.provenance.steps].count("events") == 1
    kept = files.load_pressure(path)
    np.testing.assert_array_equal(kept.pressure, pressure.pressure)
    assert (kept.rate, {name: getattr(kept, name) for name in how}) == (250, how)
    for lossy in (other, replace(pressure, pressure=pressure.pressure + 1)):
        with pytest.raises(InputError, match="holds a calibration; give calibration=, force=True"):
            save(lossy, path)
    save(take, tmp_path / "b.h5")
    assert load_calibration(tmp_path / "b.h5").identifier == calibration.identifier
    save(recording, path, calibration=replace(calibration, date="2026-01-01"))
    assert files.load_pressure(path) is None, "it is that of another calibration"
    save(other, path, force=True)
    assert load_calibration(path) is None
    save_solution(solution, drive, target=target)
    for part in (load(drive), load(drive).drive):
        save(part, drive)
    assert files.load_target(drive).frames == target.frames
    np.testing.assert_array_equal(load(drive).error, solution.error)


def test_refuses_pressure_of_another_sensor(recording, path):
    with pytest.raises(MismatchError, match=r"expected pressure of \(3, 5\) cells, got \(4, 4\)"):
        save(recording, path, pressure=PressureFrames(pressure=np.zeros((3, 4, 4)), rate=250, sensor=SensorGrid()))


def test_keeps_a_long_provenance(recording, tmp_path):
    life = recording.provenance
    for i in range(2000):
        life = life.then("correct", {"round": i, "what": "x" * 50})
    save(replace(recording, provenance=life), tmp_path / "a.h5")
    assert load(tmp_path / "a.h5").provenance == life


def test_lists_the_parts_of_a_recording_and_refuses_files_of_others(recording, calibration, tmp_path):
    save(recording, tmp_path / "a.h5", calibration=calibration)
    seen = contents(tmp_path / "a.h5")
    assert (seen.kind, seen.frames, seen.parts) == ("recording", 40, ("calibration",))
    assert seen.created_by == f"midair {__version__}"
    assert seen.created.endswith("+00:00")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = [1, 2]
    with pytest.raises(BrokenFileError, match="an HDF5 file of another program"):
        contents(tmp_path / "a.h5")


GIVEN = {"rate": 1000, "unit": "V", "sensor": SensorGrid(rows=1, columns=2)}


@pytest.mark.long
def test_a_bomb_of_numpy(tmp_path):
    rows = EXPANDED_ANYWAY // 16 + 1
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (rows, 2)})
        archive.writestr("x.npy", head.getvalue() + bytes(16 * rows))
    with pytest.raises(BrokenFileError, match="write it without compression"):
        open_take(tmp_path / "a.npz", **GIVEN)


@pytest.mark.parametrize("ending", [".mat", ".npz", ".h5"])
def test_silence_is_no_bomb(ending, tmp_path):
    """Half a second of 16 channels at 48 kHz, all zero."""
    silent = Recording(samples=np.zeros((24_000, 4, 4)), rate=48_000.0, sensor=SensorGrid(), unit="V")
    save(silent, tmp_path / f"a{ending}")
    np.testing.assert_array_equal(open_take(tmp_path / f"a{ending}").recording.samples, silent.samples)
