import hashlib

import pytest

from midair.datasets.catalogue import SAMPLES, sample, sample_path, samples
from midair.errors import InputError
from midair.evaluate import perceptual_card
from midair.files import open_take
from midair.model import PressureFrames, SensorGrid
from midair.recordings import Footprint, footprint_field

CONNECT = "58c8e304d9723d5dc18eca75b2597a96287577b939b3b49fa5027ffffc4291b8"
REAL = [name for name, each in SAMPLES.items() if each.file]
MADE = [name for name, each in SAMPLES.items() if not each.file]


@pytest.mark.parametrize("name", REAL)
def test_every_sample_has_its_licence_and_source_beside_it(name):
    folder = sample_path(name).parent
    granted = {"MIT": "Permission is hereby granted", "Apache-2.0": "Apache License"}[SAMPLES[name].licence]
    assert granted in (folder / "LICENSE").read_text()
    source = (folder / "SOURCE.md").read_text()
    assert sample_path(name).name in source
    about = SAMPLES[name]
    assert about.name == name
    commit = about.source.split(" at ")[1].split(";")[0]
    assert commit in source


def test_denim_is_the_original_byte_by_byte():
    digest = hashlib.sha256(sample_path("denim").read_bytes()).hexdigest()
    assert digest == "92d01b74784361b9f67fe6da5f8bcfbb89913d64fa8cbff90149de9b6f0524f4"


def test_denim_is_a_real_recording_that_names_its_origin():
    recording = sample("denim")
    assert recording.samples.shape == (424, 4, 4)
    assert recording.unit == "count"
    assert not recording.provenance.simulated
    assert recording.provenance.source == "Denim_F180_V-50mmps_0.csv"
    assert recording.provenance.notes["licence"] == "MIT"
    assert "10.3389/fnbot.2022.808222" in recording.provenance.notes["origin"]
    assert recording.provenance.notes["material"] == "Denim"


def test_lists_what_there_is():
    assert [entry.name for entry in samples()] == list(SAMPLES)


def test_refuses_an_unknown_name():
    with pytest.raises(InputError, match="expected one of denim, connect, brush, sponge, towel, got 'velvet'"):
        sample("velvet")


def test_connect_is_the_original_and_is_felt_under_a_palm():
    assert hashlib.sha256(sample_path("connect").read_bytes()).hexdigest() == CONNECT
    effect = open_take(sample_path("connect"), scale=200.0).recording
    assert not effect.provenance.simulated
    field = footprint_field(effect, Footprint(shape="circle", size=20e-3, speed=0.0), SensorGrid())
    frames = PressureFrames(pressure=field.samples, rate=field.rate, band=(20.0, 470.0))
    assert perceptual_card(frames, frames).figure("Pacinian power, original").overall > 10


@pytest.mark.parametrize("name", MADE)
def test_what_is_made_says_so_and_can_be_felt(name):
    recording = sample(name)
    assert recording.provenance.simulated
    assert recording.unit == "Pa"
    assert 30 <= recording.samples.max() <= 61
    frames = PressureFrames(pressure=recording.samples, rate=recording.rate, band=(20.0, 470.0))
    assert perceptual_card(frames, frames).figure("Pacinian power, original").overall > 2
    with pytest.raises(InputError, match="made by"):
        sample_path(name)
