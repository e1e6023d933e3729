import numpy as np
import pytest

from midair.study import analyse, data_of_columns, report_page
from midair.study.study_report import study_pictures

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
    report = analyse(data_of_columns(table, rating="rating", within=within, simulated=True, **names), draws=50)
    return report, report_page(report, title="Touch", within=within)


def test_every_column_is_explained_in_the_page(reported):
    report, page = reported
    for finding in report.findings:
        for name, meaning in finding.legend:
            if name != "note":
                assert f"<b>{name}</b>: {meaning}".replace("'", "&#39;") in page, (finding.title, name)


def test_format_of_p_values(reported):
    _, page = reported
    cells = [part.split("</td>")[0] for part in page.split('data-name="p_Holm">')[1:]]
    assert len(cells) > 10
    assert all(cell in ("&lt; .001", "none") or 0.001 <= float(cell) <= 1 for cell in cells)


def test_a_picture_is_no_wider_than_half_a_page(reported):
    report, _ = reported
    rows = study_pictures(report, within=("surface", "object", "rated"))
    assert [len(row.panels) for row in rows] == [2, 1, 2]
    # A telephone of 390 pixels shows them at .6 of their size without scrolling.
    assert max(panel.size[0] for row in rows for panel in row.panels) * 0.6 < 346


@pytest.mark.slow
@pytest.mark.parametrize(("width", "media"), [(1200, "screen"), (390, "screen"), (718, "print")])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_does_not_overflow(reported, overflowing, width, media, scheme):
    assert overflowing(reported[1], width, media=media, color_scheme=scheme) == []
