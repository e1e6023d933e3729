import base64
import hashlib
import io
import json
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from matplotlib import colormaps
from tests.view.shown import ARRAY, GRID, focus, focus_drive, focus_target, pressure, recording
from tests.view.test_frame_encoding import node

from midair.errors import InputError
from midair.physics import propagate
from midair.view import (
    WEB,
    Channels,
    channel_sound,
    check_size,
    metadata,
    sections,
    show_comparison,
    show_drive,
    show_page,
    show_recording,
    show_target,
    unpack,
    with_content_policy,
)
from midair.view.frame_encoding import size_of
from midair.view.pages import comparison_sounds, one_module
from midair.view.view_data import played_field


def test_scripts_are_modules_without_mistakes(subtests):
    for part in ["view.js", "transport.js", "page.js", "all"]:
        with subtests.test(part=part):
            text = one_module() if part == "all" else (WEB / part).read_text(encoding="utf-8")
            checked = subprocess.run(
                [*node(), "--check", "--input-type=module"], input=text, capture_output=True, text=True
            )
            assert checked.stderr == ""
            assert part != "all" or "import " not in re.sub(r"/\*.*?\*/|//.*", "", text, flags=re.DOTALL)


def test_page_refers_to_no_other_address():
    page = show_page(focus(), commands=("midair show x.drive.h5",))
    assert re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?(?!data:)[^"\'\s)]+', page) == []
    assert "http" not in page.replace("http-equiv", "")
    assert "SIMULATED" in page
    assert "midair show x.drive.h5" in page


def test_the_frames_are_inside_and_foreign_text_is_escaped():
    page = show_page(show_recording(recording()))
    (held,) = re.findall(r'data-name="samples">([^<]*)<', page)
    assert unpack(base64.b64decode(held))[0].values.shape == (60, 16)
    said = replace(recording().provenance, notes={"object": "</script><b>x"})
    page = show_page(show_recording(replace(recording(), provenance=said)))
    assert "<b>x" not in page
    (held,) = re.findall(r'data-name="about">([^<]*)<', page)
    assert json.loads(held)["title"] == "</script><b>x"


def test_only_its_own_scripts_and_styles_may_run():
    page = with_content_policy('<meta charset="utf-8"><style>p {}</style><script type="module">let a</script>')
    for text in ("p {}", "let a"):
        assert base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() in page
    assert "default-src 'none'" in page
    assert "unsafe" not in page


def test_a_tone_keeps_its_frequency_and_peaks_near_full_scale_and_a_rest_makes_no_click():
    shown = show_recording(recording(500))
    heard = channel_sound(shown.samples, 6, shown.rate)
    sound, rate = soundfile.read(io.BytesIO(heard.data))
    assert (rate, sound.shape) == (48000, (24000,))
    assert np.abs(sound).max() == pytest.approx(0.9, abs=1e-3)
    assert np.abs(np.fft.rfft(sound)).argmax() * rate / len(sound) == pytest.approx(100, abs=2)
    assert heard.full_scale * 0.9 == pytest.approx(1, rel=0.02)
    still = Channels(values=np.full((300, 2), 5.0), unit="V", label="rest")
    sound, _ = soundfile.read(io.BytesIO(channel_sound(still, 1, 1000).data))
    assert np.abs(sound).max() == 0


def test_both_sounds_have_one_scale():
    (_, first), (name, second) = comparison_sounds(show_comparison(pressure(), pressure(scale=0.5)))
    loud, soft = (np.abs(soundfile.read(io.BytesIO(each.data))[0]).max() for each in (first, second))
    assert name == "re-recorded"
    assert (loud, soft / loud) == pytest.approx((0.9, 0.5), abs=1e-3)
    assert comparison_sounds(focus()) == ()


def test_samples_come_in_sections_of_a_quarter_of_a_second_with_the_numbers_of_their_frames():
    shown = show_recording(recording(600))
    parts = unpack(sections(shown)["samples"])
    assert [(part.first, len(part.values)) for part in parts] == [(0, 250), (250, 250), (500, 100)]
    assert {part.values.dtype.str for part in parts} == {"<i2"}
    found = np.concatenate([part.values * part.unit for part in parts])
    assert np.abs(found - shown.samples.values).max() < 1e-4
    part = (0.002, 0.004)
    shown = show_drive(focus_drive(), target=focus_target(), part=part)
    held = {name: [each.first for each in unpack(data)] for name, data in sections(shown).items()}
    assert held == {"wanted": [2], "played": [2], "phases": [2, 3, 4, 5]}
    assert metadata(shown)["first"] == 2
    (samples,) = unpack(sections(show_recording(recording(), part=part))["samples"])
    assert (samples.first, samples.time) == (2, 0.005)


def test_size_is_estimated_before_packing_and_a_minute_of_a_drive_fits_a_page():
    for shown in (focus(), show_recording(recording(600))):
        made = sum(map(len, sections(shown).values()))
        assert size_of(shown) == pytest.approx(made, rel=0.05)
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


def test_a_recording_begins_with_its_loudest_channel_and_has_no_sound_as_a_target_has_no_samples():
    shown = show_recording(recording())
    assert (shown.title, shown.frames, shown.channel, shown.samples.unit) == ("tone", 60, 6, "V")
    assert shown.sound is None
    calibrated = show_recording(recording(), pressure=pressure(scale=3)).samples
    assert calibrated.unit == "Pa"
    assert calibrated.values.max() == pytest.approx(3, rel=0.05)
    target = show_target(focus_target())
    assert target.sound.played is None
    assert target.samples is None


def test_the_played_field_is_that_of_the_drive_on_the_scale_of_its_target():
    drive = focus_drive(600)
    assert np.allclose(played_field(drive, GRID), propagate(drive, GRID))
    shown = focus()
    assert shown.simulated, "the field is a model's"
    assert shown.sound.top == pytest.approx(max(3000, np.abs(shown.sound.played).max()))
    assert np.abs(shown.sound.played[0]).argmax() == 9 * 16 + 6


def test_a_comparison_is_as_long_as_both():
    shown = show_comparison(pressure(60), pressure(50))
    assert (shown.frames, len(shown.samples.values), len(shown.again.values)) == (50, 50, 50)
