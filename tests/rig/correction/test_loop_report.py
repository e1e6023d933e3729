import html
import re
from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import ALL, ALL_MEASURED, LaboratoryLoss, PalmFidelity, PressedPalm
from midair.figures import Picture
from midair.figures.style import new_figure, png_bytes
from midair.model import PressureFrames, SensorGrid, frames_without_lead
from midair.rig.correction import loop_report
from midair.rig.correction.loop_report import strongest_channels, view_of_loop, write_report
from midair.rig.correction.outcomes import Outcome


def written(loop, folder):
    write_report(loop, folder / "report.html", commands=("midair loop x.h5",))
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(loop, tmp_path_factory):
    """With one small picture in place of those that take seconds to draw."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        one = Picture(title="Vibration on a palm", data=png_bytes(new_figure(2.0, 1.0, simulated=True), dpi=50))
        monkeypatch.setattr(loop_report, "drawn", lambda loop, card, progress: [one])
        return written(loop, tmp_path_factory.mktemp("page"))


@pytest.mark.long
def test_the_page_is_self_contained(loop, tmp_path):
    page = written(loop, tmp_path)
    assert "Target and reproduced field" in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    assert not re.search(r"https?:", page)
    assert page.count("data:image/png;base64,") == 6 + 2, "figures, and two maps on the cells"
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy.startswith("default-src 'none'; img-src data:; media-src data:;")
    assert policy.count("script-src 'sha256-") == 1


@pytest.mark.long
def test_the_view_has_pressure_and_sound(page):
    assert set(re.findall(r'data-name="(\w+)"', page)) == {"about", "samples", "again", "wanted", "played", "phases"}
    assert page.count('src="data:audio/wav;base64,') == 2


def test_the_page_has_all_sections(loop, page):
    for words in (
        "SIMULATED",
        "Towel, reproduced in midair",
        "E as the solver measures it, mean",
        "midair loop x.h5",
        "numpy",
        "band",
    ):
        assert words in page
    assert re.search(r"<details><summary>How it was computed (?s:.*)numpy", page), "long tables are folded"
    text = html.unescape(re.sub(r"<[^>]+>", "", page))
    for name, line in Outcome.of(loop).verdict.rows():
        assert name.capitalize() + " " + line in text if name == "felt" else name + line in text
    made = loop.passes[-1].reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    assert f"{100 * made.solution.error[inside].mean():.3g}" in page


@pytest.mark.long
def test_only_a_rectified_original_is_said_to_lose_its_negative_half(loop, page, tmp_path, monkeypatch):
    monkeypatch.setattr(loop_report, "drawn", lambda loop, card, progress: [])
    assert "negative half cannot be played" in page
    assert "negative half" not in written(replace(loop, settings=loop.settings.but(mapping="slow-bias")), tmp_path)


@pytest.mark.browser
def test_the_page_is_small_and_has_the_answer_first(loop, tmp_path, chromium):
    """At most 2 MB and 4000 px, also with a palm, other outcomes and a laboratory; the view draws once it is opened."""
    square = PressedPalm(wanted=np.ones((35, 35)), delivered=np.ones((35, 35)), pitch=2.5e-3, square=(27.5e-3, 27.5e-3))
    skins = {"soft, deep": 12.0, "stiff, deep": 14.5}
    palm = PalmFidelity(outside=0.01, pressure=9.0, square=11.0, displacement=skins, palm="disc", pressed=square)
    outcomes = [Outcome.of(loop, palm=palm, name=name) for name in ("the best mode", "the paper's mode")]
    lab = LaboratoryLoss(
        nominal=28.0,
        ratios={ALL: np.linspace(4, 20, 9), ALL_MEASURED: np.linspace(22, 30, 9), "units": np.linspace(9, 15, 9)},
        stated={"units": "0.5 mm, 0.3 deg", "palm height": "3 mm", "echo": "10 %"},
        seed=0,
    )
    own = replace(outcomes[0], verdict=replace(outcomes[0].verdict, laboratory=lab, excess=36.8, option="--gain 1.22"))
    path = tmp_path / "report.html"
    write_report(loop, path, source="take.h5", beside=[own, outcomes[1]], laboratory=lab)
    assert path.stat().st_size < 2e6
    for width, most in ((1400, 4000), (390, 5000)):
        opened, wrong = chromium.new_page(viewport={"width": width, "height": 900}), []
        opened.on("console", lambda said: wrong.append(said.text))  # noqa: B023
        opened.on("pageerror", lambda error: wrong.append(str(error)))  # noqa: B023
        opened.goto(path.as_uri())
        tall, wide, first = opened.evaluate(
            """() => [document.documentElement.scrollHeight, document.documentElement.scrollWidth,
                document.querySelector(".message").getBoundingClientRect().bottom]"""
        )
        assert (tall <= most, wide <= width, first < 400) == (True, True, True), (width, tall, wide, first)
        opened.locator("summary").first.click()
        opened.wait_for_function("document.querySelector('.midair-view canvas').clientWidth > 50")
        opened.close()
        assert wrong == []


@pytest.mark.browser
def test_no_table_lies_beyond_the_edge_of_a_telephone(page, chromium):
    """A picture is moved under the finger; words and numbers are not."""
    opened = chromium.new_page(viewport={"width": 390, "height": 900})
    opened.set_content(page.replace("<details", "<details open"))
    beyond = opened.evaluate(
        """() => [...document.querySelectorAll(".wide:has(table)")]
            .filter(one => one.scrollWidth > one.clientWidth + 1).map(one => one.previousElementSibling.innerText)"""
    )
    opened.close()
    assert beyond == []


def touched(channels, sensor):
    """Pressure on these channels, the harder the later in the list."""
    pressure = np.zeros((50, sensor.count))
    for loudness, channel in enumerate(channels, 1):
        pressure[:, channel] = loudness * np.sin(np.arange(50))
    return PressureFrames(pressure=pressure.reshape(50, *sensor.shape), rate=1000.0, band=(20.0, 400.0), sensor=sensor)


def test_the_channels_that_were_pressed_hardest_are_shown(subtests):
    for channels in [[5, 0, 9, 1], [3, 7]]:
        with subtests.test(channels=channels):
            found = strongest_channels(touched(channels, SensorGrid()))
            assert set(channels) <= set(found)
            assert found == sorted(found)


def test_the_view_has_recording_drive_and_rerecording(loop):
    shown = view_of_loop(loop)
    last = loop.passes[-1]
    made = last.reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    assert shown.frames == loop.original.frames == len(shown.sound.played) == len(shown.again.values)
    assert np.array_equal(shown.samples.values, loop.original.pressure.reshape(shown.frames, -1))
    assert np.array_equal(shown.again.values, last.felt.pressure[: shown.frames].reshape(shown.frames, -1))
    assert np.array_equal(shown.sound.wanted, made.target.amplitude[inside])
    assert np.array_equal(shown.sound.drive.phase, made.solution.drive.phase[inside])
    shown = view_of_loop(replace(loop, original=loop.original.cut(0, 0.05)))
    assert shown.sound is None
    assert shown.frames == 50
