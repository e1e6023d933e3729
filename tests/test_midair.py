"""The names that others rely on, what importing them costs, and the tape recorder in Python."""

import inspect
import re
import subprocess
import sys

import pytest

import midair

NAMES = {
    "classes": "Acoustics AmplitudeFrames Calibration ControlGrid Drive Medium PressureFrames Recording SensorGrid "
    "Settings Solution TransducerArray",
    "functions": "calibrate compare live load load_calibration loop open_rig open_take open_tracker play prepare "
    "propagate record save solve",
    "modules": "calibration correct datasets devices dsp errors evaluate figures files model paper patterns physics "
    "pipeline recordings rig settings solvers studio study sweep targets view",
}


def names(kind):
    return NAMES[kind].split()


def test_the_package_has_these_names_and_no_others():
    expected = sorted(["__version__", *names("classes"), *names("functions"), *names("modules")])
    assert sorted(midair.__all__) == dir(midair) == expected


@pytest.mark.parametrize("name", names("functions"))
def test_functions_have_help(name):
    function = getattr(midair, name)
    assert inspect.isfunction(function)
    assert inspect.getdoc(function)
    assert "Parameters" in inspect.getdoc(function)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'midair' has no attribute 'rewind'"):
        midair.rewind  # noqa: B018


def test_import_loads_nothing_heavy():
    heavy = {
        "scipy",
        "scipy.signal",
        "h5py",
        "matplotlib",
        "pandas",
        "soundfile",
        "rich",
        "pydantic",
        "cyclopts",
        "numba",
        "numpy",
    }
    code = "import sys, midair; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert heavy.isdisjoint(loaded)


def types_of(*functions):
    modules = ", ".join(f"midair.{module}" for module in names("modules"))
    types = f"type(getattr(midair, n)).__name__ for n in {functions}"
    code = f"import {modules}, midair.rig.correction, midair; print(*({types}))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_functions_stay_functions_after_all_imports():
    assert set(types_of(*names("functions"))) == {"function"}


@pytest.mark.slow
@pytest.mark.parametrize("name", names("functions"))
def test_each_function_is_a_function_on_first_access(name):
    assert types_of(name) == ["function"]


def test_the_command_that_newcomers_type_works():
    code = "import midair; print(dir(midair)); help(midair.record)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'record'" in said
    assert "Record a sensor for some time" in said


@pytest.fixture(scope="module")
def stages():
    """A short result of each stage before the solver."""
    take = midair.record("virtual:towel", 0.05)
    pressure = midair.calibrate(take.recording, take.calibration)
    array = midair.TransducerArray.autd3(columns=1, rows=1)
    return {
        "midair": midair,
        "take": take,
        "rec": take.recording,
        "cal": take.calibration,
        "pressure": pressure,
        "target": midair.prepare(pressure),
        "array": array,
    }


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("calibrate(cal, rec)", "recording: expected Recording, got Calibration"),
        ("calibrate('t.h5')", "got str; call midair.open_take on the file"),
        ("calibrate(take)", "got OpenedTake; use its .recording"),
        ("calibrate(rec, 't.calibration.h5')", "expected Calibration or None, got str; call midair.load_calibration"),
        ("calibrate(rec, cal, band=(470, 20))", "expected 0 <= low < high"),
        ("prepare(rec)", "pressure: expected PressureFrames, got Recording; call calibrate first"),
        ("prepare(pressure, grid=200)", "grid: expected ControlGrid or None, got int"),
        ("prepare(pressure, gain='2')", "gain of the pressure: expected a number, got '2'"),
        ("solve(pressure, array)", "target: expected AmplitudeFrames, got PressureFrames; call prepare first"),
        ("solve(array, target)", "target: expected AmplitudeFrames, got TransducerArray"),
        ("solve(target, 'autd3')", "expected TransducerArray, got str; call midair.TransducerArray.autd3()"),
        ("solve(target, array, method='lmm')", "method: expected one of lm"),
        ("compare(pressure, rec)", "reproduced: expected PressureFrames, got Recording; call calibrate first"),
        ("compare(pressure, target)", "use the pressure that it was prepared from"),
        ("play(target)", "drive: expected Drive, got AmplitudeFrames; call solve first"),
        ("play('t.drive.h5')", "got str; call midair.load on the file"),
        ("save('x.h5', rec)", "path, the second argument: expected str or PathLike, got Recording"),
        ("save(pressure, 'x.h5')", "recording: expected Recording, got PressureFrames"),
        ("load(rec)", "path: expected str or PathLike, got Recording"),
        ("record('virtual:towel', '1s')", "duration: expected a number in s, got '1s'"),
        ("record(5)", "sensor: expected str or SensorDevice, got int; give its name"),
        ("loop(rec)", "original: expected PressureFrames, got Recording; call calibrate first"),
        ("loop(rec, 'bset')", "mode: expected one of paper, best, quick, finest, quiet, got 'bset'"),
        ("ControlGrid(height=200)", "lengths are in metres, 200 mm is 0.2"),
        ("ControlGrid(height='200mm')", "height: expected a number in m, got '200mm'"),
        ("ControlGrid(rows='4')", "rows: expected a number, got '4'"),
        ("ControlGrid(rows=4000, columns=4000)", "3.67 mm pitch, 14.7 x 14.7 m; use at most 272 x 272"),
        ("TransducerArray.autd3(columns=1.5)", "units: expected whole numbers"),
        ("TransducerArray.autd3(columns='2')", "columns of units: expected a number, got '2'"),
        ("TransducerArray.autd3(columns=3000, rows=1000)", "expected at most 10000 in an array, got 3000 x 1000"),
    ],
)
def test_a_wrong_call_names_what_came_and_the_next_step(call, said, stages):
    with pytest.raises(midair.errors.InputError, match=re.escape(said)):
        eval(f"midair.{call}", stages)
