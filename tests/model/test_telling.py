"""What nouns say of themselves: short, with units, without their numbers; and their small pictures."""

import dataclasses
import inspect
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import midair.model as nouns
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Crosstalk,
    Drive,
    Event,
    Linearity,
    Measurement,
    Medium,
    Placement,
    PressureFrames,
    Provenance,
    Recording,
    SensorGrid,
    SensorWiring,
    Solution,
    Step,
    TransducerArray,
)
from midair.model.telling import short, span

RNG = np.random.default_rng(0)
LONG = "a very long name of <b>something</b> & more " * 9
STEPS = tuple(Step(stage=f"stage number {number} " * 5, settings={LONG: 1}) for number in range(40))
LIFE = Provenance(source=LONG, simulated=True, notes={LONG: LONG}, steps=STEPS)
SENSOR = SensorGrid(name=LONG)
ARRAY = dataclasses.replace(TransducerArray.autd3(), name=LONG)
DRIVE = Drive(
    phase=RNG.uniform(0, 7, (50, ARRAY.count)),
    level=RNG.uniform(0, 1, (50, ARRAY.count)),
    rate=4000.0,
    array=ARRAY,
    provenance=LIFE,
)
MEASURED = Measurement(
    **{name: np.full((5, 4, 4), 0.5) for name in ("coherence", "magnitude_uncertainty", "phase_uncertainty")},
    noise_density=np.full((5, 4, 4), 0.5),
    noise_uncertainty=np.full((4, 4), 0.5),
    delay=np.zeros((4, 4)),
    delay_uncertainty=np.zeros((4, 4)),
    reference=LONG,
    method=LONG,
)
LINEAR = Linearity(
    pressure=np.ones((5, 4, 4)) * np.linspace(1, 10, 5)[:, None, None],
    output=np.ones((5, 4, 4)),
    **{
        name: np.ones((4, 4))
        for name in ("gain", "gain_uncertainty", "intercept", "intercept_uncertainty", "curvature")
    },
    curvature_uncertainty=np.ones((4, 4)),
)

NOUNS = {
    "Acoustics": Acoustics(medium=Medium.at(temperature=22.0)),
    "AmplitudeFrames": AmplitudeFrames(amplitude=RNG.uniform(0, 9e3, (30, 256)), rate=1000.0, provenance=LIFE),
    "Calibration": Calibration(
        sensor=SENSOR,
        frequency=np.linspace(10, 500, 5),
        response=np.full((5, 4, 4), 0.02 + 0.01j),
        noise=np.full((4, 4), 1e-3),
        provenance=LIFE,
    ),
    "ControlGrid": ControlGrid(centre=(1e-3, -2e-3)),
    "Crosstalk": Crosstalk(matrix=np.where(np.eye(16) > 0, 1.0, 0.01), uncertainty=np.full((16, 16), 1e-3)),
    "Drive": DRIVE,
    "Event": Event(kind="lost", frame=3, frames=12),
    "Linearity": LINEAR,
    "Measurement": MEASURED,
    "Medium": Medium(),
    "PressureFrames": PressureFrames(
        pressure=RNG.normal(size=(5000, 4, 4)), rate=1000.0, sensor=SENSOR, provenance=LIFE
    ),
    "Placement": Placement(position=np.zeros((4, 3)), rotation=np.zeros((4, 3)), name=LONG),
    "Provenance": LIFE,
    "Recording": Recording(samples=RNG.normal(size=(5000, 4, 4)), rate=1000.0, sensor=SENSOR, provenance=LIFE),
    "SensorGrid": SENSOR,
    "SensorWiring": SensorWiring(grid=SENSOR, order=tuple(reversed(range(16))), unit="count"),
    "Solution": Solution(
        drive=DRIVE, error=RNG.uniform(0, 1, 50), iterations=np.full(50, 20), status=("converged",) * 50
    ),
    "Step": STEPS[0],
    "TransducerArray": ARRAY,
}
PICTURED = ["AmplitudeFrames", "Calibration", "Drive", "PressureFrames", "Recording", "Solution", "TransducerArray"]


def test_every_noun_is_in_the_table():
    found = {name for name in nouns.__all__ if dataclasses.is_dataclass(getattr(nouns, name, None))}
    assert found == set(NOUNS)
    assert all(inspect.isclass(getattr(nouns, name)) for name in found)


@pytest.mark.parametrize("name", NOUNS)
def test_a_repr_is_short_and_has_no_array_in_it(name):
    said = repr(NOUNS[name])
    assert len(said) < 300
    assert name in said
    assert "array(" not in said
    assert "\n" not in said


@pytest.mark.parametrize("name", ["AmplitudeFrames", "Calibration", "Drive", "PressureFrames", "Recording", "Solution"])
def test_what_is_simulated_says_so_and_numbers_have_units(name):
    said = repr(NOUNS[name])
    assert "SIMULATED" in said
    assert re.search(r"\d (Hz|V|Pa|%|s|mm|kHz|V/Pa)\b|%", said)
    honest = dataclasses.replace(NOUNS["Recording"], provenance=Provenance(source="lsl:Skin"))
    assert "SIMULATED" not in repr(honest)


def test_reprs_as_a_person_reads_them():
    recording = Recording(samples=np.array([[[0.5]], [[-0.25]]]), rate=1000.0, sensor=SensorGrid(rows=1, columns=1))
    assert repr(recording) == "<Recording 2 frames at 1000 Hz, 0.002 s, 1 x 1 'sensor', -0.25 to 0.5 V, from unknown>"
    drive = Drive(phase=np.zeros((5, 996)), level=np.ones(5), rate=1000.0, array=TransducerArray.autd3())
    assert repr(drive) == (
        "<Drive 5 frames at 1000 Hz, 0.005 s, 996 transducers of AUTD3 2 x 2, level 1, from unknown>"
    )
    silent = Solution(drive=drive, error=np.zeros(5), iterations=np.zeros(5, int), status=("silent",) * 5)
    assert repr(silent).startswith("<Solution nothing to play, 5 silent, of <Drive 5 frames")


@pytest.mark.parametrize("name", PICTURED)
def test_a_picture_is_small_well_formed_and_labelled(name):
    page = NOUNS[name]._repr_html_()
    assert len(page) < 64_000
    figure = ET.fromstring(page)
    caption = figure.find("figcaption").text
    assert name in caption
    svg = figure.find("{http://www.w3.org/2000/svg}svg")
    labels = [text.text for text in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert len(labels) == 2
    assert all(labels)
    if name != "TransducerArray":
        assert "SIMULATED" in caption
    assert "<b>" not in page


def test_nouns_without_a_picture_have_none():
    for name, noun in NOUNS.items():
        assert hasattr(noun, "_repr_html_") is (name in PICTURED)


def test_a_long_name_keeps_its_ends():
    assert short("towel") == "towel"
    assert short("a" * 30 + "z" * 30) == "a" * 19 + "…" + "z" * 19


def test_spans_have_their_unit_once():
    assert span(np.array([1.0, -2.0]), "Pa") == "-2 to 1 Pa"
    assert span(np.ones(3), "") == "1"
    assert span(np.zeros(0), "V") == "nothing"
