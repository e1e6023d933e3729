"""The names that others rely on, what importing them costs, and the tape recorder in Python."""

import inspect
import subprocess
import sys

import pytest

import midair

NAMES = {
    "nouns": "Acoustics AmplitudeFrames Calibration ControlGrid Drive Medium PressureFrames Recording SensorGrid "
    "Settings Solution TransducerArray",
    "verbs": "calibrate compare live load load_calibration loop open_rig open_take play prepare propagate record "
    "save solve",
    "rooms": "calibration correct datasets devices dsp errors evaluate figures files model paper physics pipeline "
    "recordings rig settings solvers studio study sweep targets testing view",
}


def names(kind):
    return NAMES[kind].split()


def test_the_face_has_these_names_and_no_others():
    expected = sorted(["__version__", *names("nouns"), *names("verbs"), *names("rooms")])
    assert sorted(midair.__all__) == dir(midair) == expected


@pytest.mark.parametrize("name", names("verbs"))
def test_verbs_are_functions_with_help(name):
    verb = getattr(midair, name)
    assert inspect.isfunction(verb)
    assert inspect.getdoc(verb)
    assert "Parameters" in inspect.getdoc(verb)


@pytest.mark.parametrize("name", names("rooms"))
def test_rooms_are_modules_that_say_what_they_are(name):
    room = getattr(midair, name)
    assert inspect.ismodule(room)
    assert room.__doc__


@pytest.mark.parametrize("name", names("nouns"))
def test_nouns_are_classes(name):
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


def types_of(*verbs):
    """What they are in a program that has imported every room before."""
    rooms = ", ".join(f"midair.{room}" for room in names("rooms") if room != "testing")
    code = (
        f"import {rooms}, midair.rig.correction, midair; print(*(type(getattr(midair, n)).__name__ for n in {verbs}))"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_verbs_are_functions_whatever_was_imported_before():
    assert set(types_of(*names("verbs"))) == {"function"}


@pytest.mark.slow
@pytest.mark.parametrize("name", names("verbs"))
def test_each_verb_is_a_function_also_when_it_is_the_first_that_is_asked_for(name):
    assert types_of(name) == ["function"]


def test_the_command_that_newcomers_type_works():
    code = "import midair; print(dir(midair)); help(midair.record)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'record'" in said
    assert "Record a sensor for a while." in said
