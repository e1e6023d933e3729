import hashlib

import pytest

from midair.datasets.catalogue import SAMPLES, sample, sample_path, samples
from midair.errors import InputError


@pytest.mark.parametrize("name", SAMPLES)
def test_every_sample_has_its_licence_and_source_beside_it(name):
    folder = sample_path(name).parent
    assert "Permission is hereby granted" in (folder / "LICENSE").read_text()
    source = (folder / "SOURCE.md").read_text()
    assert sample_path(name).name in source
    about = SAMPLES[name]
    assert about.name == name
    assert about.licence == "MIT"
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
    with pytest.raises(InputError, match="expected one of denim, got 'velvet'"):
        sample("velvet")
