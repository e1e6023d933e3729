import hashlib
from dataclasses import replace

import numpy as np
import pytest

from midair.calibration import calibrate
from midair.datasets.strokes import SAMPLES, sample, sample_path, with_credits
from midair.errors import InputError
from midair.evaluate import felt
from midair.files import open_take
from midair.model import SensorGrid
from midair.recordings import Footprint, footprint_field, resample

CONNECT = "58c8e304d9723d5dc18eca75b2597a96287577b939b3b49fa5027ffffc4291b8"
REAL = [name for name, each in SAMPLES.items() if each.file]
MADE = [name for name, each in SAMPLES.items() if not each.file]


def test_every_sample_has_its_licence_and_source_beside_it(subtests):
    for name in REAL:
        with subtests.test(name=name):
            folder = sample_path(name).parent
            granted = {"MIT": "Permission is hereby granted", "Apache-2.0": "Apache License"}[SAMPLES[name].licence]
            assert granted in (folder / "LICENSE").read_text()
            source = (folder / "SOURCE.md").read_text()
            assert sample_path(name).name in source
            about = SAMPLES[name]
            assert about.name == name
            commit = about.source.split(" at ")[1].split(";")[0]
            assert commit in source


def test_sample_files_are_the_published_originals(subtests):
    for name, digest in [
        ("denim", "92d01b74784361b9f67fe6da5f8bcfbb89913d64fa8cbff90149de9b6f0524f4"),
        ("ridges", "f5b4f9dec5270de8fae13efdd1b6b2b52b09f19dafce875b87435635f9be8b3c"),
    ]:
        with subtests.test(name=name):
            assert hashlib.sha256(sample_path(name).read_bytes()).hexdigest() == digest


def test_samples_name_their_origin_and_licence():
    recording = sample("denim")
    assert recording.samples.shape == (424, 4, 4)
    assert recording.unit == "count"
    assert not recording.provenance.simulated
    assert recording.provenance.source == "Denim_F180_V-50mmps_0.csv"
    assert recording.provenance.notes["licence"] == "MIT"
    assert "10.3389/fnbot.2022.808222" in recording.provenance.notes["origin"]
    assert recording.provenance.notes["material"] == "Denim"
    read = open_take(sample_path("connect"), scale=200.0).recording
    assert "licence" not in read.provenance.notes
    assert with_credits("connect", read).provenance.notes["licence"] == "Apache-2.0"


def felt_by(recording):
    """How many of ten people feel a recording that is reproduced perfectly."""
    pressure = calibrate(recording)
    return felt(pressure.pressure, pressure.rate, pressure.sensor.pitch)


@pytest.mark.long
def test_ridges_are_a_real_recording_at_a_level_that_can_be_felt():
    recording = sample("ridges")
    assert (recording.unit, recording.rate, recording.sensor.shape) == ("Pa", 1000, (4, 4))
    assert not recording.provenance.simulated
    assert float(np.abs(recording.samples).max()) == pytest.approx(90)
    notes = recording.provenance.notes
    assert notes["licence"] == "MIT"
    assert "10.3389/fnbot.2022.808222" in notes["origin"]
    assert "not measured" in notes["level"]
    assert "ten times as fast" in notes["speed"]
    assert notes["felt"] == str(felt_by(recording))


def test_ridges_have_a_period_of_four_millimetres():
    """2 mm of ridge and 2 mm of groove: 5 Hz at the robot's 20 mm/s, and 50 Hz ten times as fast."""
    original, quick = open_take(sample_path("ridges")).recording, sample("ridges")
    for recording, band, expected in ((original, (2.0, 15.0), 5.0), (quick, (20.0, 470.0), 50.0)):
        change = np.asarray(recording.samples).reshape(recording.frames, -1)
        change = change - np.median(change, axis=0)
        power = np.abs(np.fft.rfft(change * np.hanning(len(change))[:, None], n=8 * len(change), axis=0)) ** 2
        frequency = np.fft.rfftfreq(8 * len(change), 1 / recording.rate)
        inside = (frequency > band[0]) & (frequency < band[1])
        assert frequency[inside][power[inside].sum(axis=1).argmax()] == pytest.approx(expected, rel=0.02)


@pytest.mark.long
def test_denim_is_below_threshold_at_the_level_in_the_docs():
    recording = sample("denim")
    change = np.asarray(recording.samples) - np.median(recording.samples, axis=0)
    slow = replace(recording, samples=30 * change / np.abs(change).max(), unit="Pa")
    pressure = calibrate(resample(slow, 1000.0), band=(0.5, 15.0))
    assert felt(pressure.pressure, pressure.rate, pressure.sensor.pitch).people[0] == 0


@pytest.mark.long
def test_connect_is_the_original_and_can_be_felt():
    assert hashlib.sha256(sample_path("connect").read_bytes()).hexdigest() == CONNECT
    effect = open_take(sample_path("connect"), scale=200.0).recording
    assert not effect.provenance.simulated
    field = footprint_field(effect, Footprint(shape="circle", size=20e-3, speed=0.0), SensorGrid())
    assert felt(field.samples, field.rate, field.sensor.pitch).people[0] >= 9


@pytest.mark.long
def test_synthetic_samples_are_marked_and_can_be_felt(subtests):
    for name in MADE:
        with subtests.test(name=name):
            recording = sample(name)
            assert recording.provenance.simulated
            assert recording.unit == "Pa"
            assert 30 <= recording.samples.max() <= 61
            assert felt(recording.samples, recording.rate, recording.sensor.pitch).people[0] >= 4
            with pytest.raises(InputError, match="made by"):
                sample_path(name)
