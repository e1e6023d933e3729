"""The names that others rely on, what importing them costs, and the tape recorder in Python."""

import inspect
import subprocess
import sys

import pytest

import midair

NAMES = {
    "classes": "Acoustics AmplitudeFrames Calibration ControlGrid Drive Medium PressureFrames Recording SensorGrid "
    "Settings Solution TransducerArray",
    "functions": "calibrate compare live load load_calibration loop open_rig open_take play prepare propagate record "
    "save solve",
    "modules": "calibration correct datasets devices dsp errors evaluate figures files model paper physics pipeline "
    "recordings rig settings solvers studio study sweep targets view",
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


@pytest.mark.parametrize("name", names("modules"))
def test_modules_have_a_docstring(name):
    module = getattr(midair, name)
    assert inspect.ismodule(module)
    assert module.__doc__


@pytest.mark.parametrize("name", names("classes"))
def test_classes(name):
    assert inspect.isclass(getattr(midair, name))


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
    """Types of names in a program that has imported every module."""
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
