import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import colormaps
from tests.view.shown import ARRAY, focus, focus_drive, focus_target, recording

from midair.errors import InputError
from midair.view import check_size, metadata, sections, show_drive, show_recording, size_of, unpack


def test_samples_come_in_sections_of_a_quarter_of_a_second():
    shown = show_recording(recording(600))
    parts = unpack(sections(shown)["samples"])
    assert [(part.first, len(part.values), part.values.dtype.str) for part in parts] == [
        (0, 250, "<i2"),
        (250, 250, "<i2"),
        (500, 100, "<i2"),
    ]
    found = np.concatenate([part.values * part.unit for part in parts])
    assert np.abs(found - shown.samples.values).max() < 1e-4


def test_a_part_keeps_the_numbers_of_its_frames():
    part = (0.002, 0.004)
    shown = show_drive(focus_drive(), target=focus_target(), part=part)
    held = {name: [each.first for each in unpack(data)] for name, data in sections(shown).items()}
    assert held == {"wanted": [2], "played": [2], "phases": [2, 3, 4, 5]}
    assert metadata(shown)["first"] == 2
    (samples,) = unpack(sections(show_recording(recording(), part=part))["samples"])
    assert (samples.first, samples.time) == (2, 0.005)


def test_target_field_and_phases_of_a_drive():
    shown = focus()
    held = {name: unpack(data) for name, data in sections(shown).items()}
    assert set(held) == {"wanted", "played", "phases"}
    (played,) = held["played"]
    pairs = (played.values * played.unit).reshape(8, 256, 2)
    assert np.abs(pairs[..., 0] + 1j * pairs[..., 1] - shown.sound.played).max() < shown.sound.top / 30000
    assert [part.first for part in held["phases"]] == list(range(8))
    turned = held["phases"][0].values[0] * held["phases"][0].unit
    assert np.abs(np.exp(1j * turned) - np.exp(1j * focus_drive().phase[0])).max() < 2 * np.pi / 256


def test_size_is_estimated_before_packing():
    for shown in (focus(), show_recording(recording(600))):
        made = sum(map(len, sections(shown).values()))
        assert size_of(shown) == pytest.approx(made, rel=0.05)


def test_a_minute_of_a_drive_fits_a_page_and_two_do_not():
    shown = focus()
    long = replace(shown, frames=65_000)
    assert size_of(long) < 64 * 2**20
    check_size(long)
    with pytest.raises(InputError, match="show a part"):
        check_size(replace(shown, frames=120_000))


def test_metadata_fits_json():
    told = json.loads(json.dumps(metadata(focus())))
    assert len(told["positions"]) == 2 * ARRAY.count
    assert len(base64.b64decode(told["field"]["down"])) == 4 * 64 * 16
    table = np.frombuffer(base64.b64decode(told["colours"]["inferno"]), np.uint8).reshape(256, 3)
    assert np.abs(table - 255 * np.array(colormaps["inferno"].colors)).max() <= 1
