from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from midair.evaluate import PalmFidelity, PressedPalm
from midair.rig.correction.outcomes import Outcome, comparison_rows, next_step, palm_maps
from midair.settings import Settings

PRESSED = PressedPalm(wanted=np.ones((9, 9)), delivered=np.full((9, 9), 2.0), pitch=5e-3, square=(15e-3, 15e-3))


def palm(outside):
    skins = MappingProxyType({"soft": 12.0, "stiff": 14.5})
    return PalmFidelity(outside=outside, pressure=9.0, square=11.0, displacement=skins, palm="mine", pressed=PRESSED)


@pytest.fixture(scope="module")
def ways(loop):
    leaks = {"the best mode": 0.01, "the other": 0.95}
    return [Outcome.of(loop, palm=palm(leak), name=name) for name, leak in leaks.items()]


def test_every_way_has_every_row(ways):
    rows = {name: (unit, values) for name, unit, *values in comparison_rows(ways)}
    assert set(ways[0].loop.passes[-1].comparison.ratios) <= set(rows)
    assert rows["leak: power beside the recorded square"] == ("%", ["1.0", "95.0"])
    assert rows["signal to distortion of the skin's movement"] == ("dB", ["12.0 to 14.5"] * 2)
    assert dict(ways[0].verdict.rows()) == {name: rows[name][1][0] for name in ("felt", "alike", "level", "ears")}
    assert rows["solver, frames"][1][0] == f"lm, {ways[0].loop.passes[-1].reproduction.target.frames} at 1000 Hz"
    assert all(len(values) == 2 for _, values in rows.values())


def test_the_maps_are_of_a_palm_if_there_is_one_and_of_the_cells_otherwise(ways):
    shown = palm_maps(ways)
    assert [name for name, *_ in shown["maps"]] == ["original", "the best mode", "the other"]
    assert [note.partition("; ")[2] for _, note, _ in shown["maps"][1:]] == [
        "1 % of the power beside it",
        "95 % of the power beside it",
    ]
    assert (shown["half"], shown["square"], shown["top"]) == ([22.5, 22.5], [15.0, 15.0], "2")
    cells = palm_maps([replace(ways[0], palm=None)])
    assert [name for name, *_ in cells["maps"]] == ["original", "the best mode"]
    assert cells["half"] == cells["square"] == pytest.approx([22.0, 22.0])


def test_the_next_step_corrects_the_level(subtests):
    for gain, settings, said in [
        (0.806, Settings(), "--gain 1.24"),
        (0.806, Settings().but(gain=1.24), "--gain 1.54"),
        (1.44, Settings().but(strength=0.12), "--strength 0.1"),
        (1.03, Settings(), ""),
        (-0.5, Settings(), ""),
        (0.5, None, ""),
    ]:
        with subtests.test(gain=gain):
            assert next_step(gain, settings) == said
