from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from midair.study import analyse, confusion_matrix, data_of_columns, report_page
from midair.study.findings.choice_findings import Choices
from midair.study.study_report import confusion_figure, f_figure, rating_figure, study_pictures
from midair.study.tables import legend_of

OBJECTS = ["brush", "sponge", "towel"]


@pytest.fixture(scope="module")
def reported():
    rng = np.random.default_rng(0)
    who, surface, thing, _ = np.indices((6, 2, 3, 4)).reshape(4, -1)
    right = np.array(OBJECTS)[thing]
    table = {
        "participant": np.array([f"sub-{i:02d}" for i in who]),
        "surface": np.where(surface, "plain", "grooved"),
        "object": right,
        "rated": np.array(OBJECTS)[np.arange(who.size) % 3],
        "answer": np.where(rng.random(who.size) < 0.6, right, rng.choice(OBJECTS, who.size)),
        "rating": rng.integers(1, 8, who.size),
    }
    names = {"participant": "participant", "presented": "object", "answered": "answer", "condition": "surface"}
    within = ("surface", "object", "rated")
    report = analyse(
        data_of_columns(table, rating="rating", within=within, simulated="SIMULATED: no person was asked", **names),
        draws=50,
    )
    return report, report_page(report, title="Touch", within=within)


@pytest.mark.long
def test_every_column_is_explained_in_the_page_and_p_values_are_rounded(reported):
    report, page = reported
    for finding in report.findings:
        for name, meaning in legend_of(finding):
            if name != "note":
                assert f"<b>{name}</b>: {meaning}".replace("'", "&#39;") in page, (finding.title, name)
    cells = [part.split("</td>")[0] for part in page.split('data-name="p_Holm">')[1:]]
    assert len(cells) == 7
    assert all(cell in ("&lt; .001", "none") or 0.001 <= float(cell) <= 1 for cell in cells)


@pytest.mark.long
def test_a_picture_is_no_wider_than_half_a_page(reported):
    report, _ = reported
    rows = study_pictures(report, within=("surface", "object", "rated"))
    assert [len(row.panels) for row in rows] == [2, 1, 2]
    # A telephone of 390 pixels shows them at .6 of their size without scrolling.
    assert max(panel.size[0] for row in rows for panel in row.panels) * 0.6 < 346


@pytest.mark.long
def test_the_page_does_not_overflow(reported, chromium):
    """No element leaves a page of some width, or scrolls although it may be wide."""
    for width, media in ((1200, "screen"), (390, "screen"), (718, "print")):
        page = chromium.new_page(viewport={"width": width, "height": 900})
        for scheme in ("light", "dark"):
            page.emulate_media(media=media, color_scheme=scheme)
            page.set_content(reported[1])
            beyond = page.evaluate(
                """() => [...document.querySelectorAll("body *")].filter(one =>
                    one.getBoundingClientRect().right > document.documentElement.clientWidth + 1
                    || (one.classList.contains("wide") && one.scrollWidth > one.clientWidth + 1))
                    .map(one => one.outerHTML)"""
            )
            assert beyond == [], (width, media, scheme)
        page.close()


def choices(name):
    answer = ["brush", "sponge", "towel", "towel", "sponge", "brush"]
    confusion = confusion_matrix(OBJECTS * 2, answer, labels=OBJECTS)
    return Choices(name=name, confusion=confusion, f_limits=None)


def test_confusions_show_every_count_and_bars_the_f_measures_above_chance():
    figure = confusion_figure([choices("plain"), choices("grooved")], simulated=True)
    assert [axes.get_title("left") for axes in figure.axes] == ["plain", "grooved"]
    assert [text.get_text() for text in figure.axes[0].texts] == [str(n) for n in [1, 0, 1, 0, 2, 0, 1, 0, 1]]
    assert any(text.get_text() == "SIMULATED" for text in figure.texts)
    figure = f_figure([choices("plain"), choices("grooved")], simulated=False)
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    assert heights == pytest.approx([0.5, 1, 0.5] * 2)
    assert figure.axes[0].lines[0].get_ydata()[0] == pytest.approx(1 / 3)
    assert not figure.texts


def test_ratings_are_drawn_by_one_or_two_factors():
    for names in (["rated"], ["object", "rated"]):
        where = np.indices((3,) * len(names)).reshape(len(names), -1)
        columns = {name: np.array([f"{name}{i}" for i in row]) for name, row in zip(names, where, strict=True)}
        mean = np.linspace(2, 6, where.shape[1])
        ratings = pd.DataFrame({**columns, "mean": mean, "low": mean - 1, "high": mean + 1})
        (axes,) = rating_figure(ratings, names, simulated=False, title="", span=(0, 8)).axes
        shown = [y for box in axes.containers for y in box.lines[0].get_ydata()]
        assert sorted(shown) == pytest.approx(mean.tolist()), names


@pytest.mark.long
def test_long_names_stay_apart_and_inside():
    names = [f"corduroy-0{i}.fade" for i in range(4)]
    shown = [Choices(name="all", confusion=confusion_matrix(names, names, labels=names), f_limits=None)]
    table = pd.DataFrame({"cloth": names * 2, "hand": [f"the {i} hand" for i in range(2) for _ in names]})
    table = table.assign(mean=3.0, low=2.0, high=4.0)
    both = [
        rating_figure(part, list(part)[-4::-1], simulated=True, title="", span=(0, 8))
        for part in (table[["cloth", "mean", "low", "high"]][:4], table)
    ]
    for figure in (confusion_figure(shown, simulated=True), f_figure(shown, simulated=True), *both):
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        labels = [label.get_window_extent() for label in figure.axes[0].get_xticklabels()]
        slanted = figure.axes[0].get_xticklabels()[0].get_rotation() > 0
        assert slanted or all(left.x1 < right.x0 for left, right in pairwise(labels))
        for box in [*labels, *(legend.get_window_extent() for legend in figure.legends)]:
            assert 0 <= box.x0 < box.x1 <= figure.bbox.x1
