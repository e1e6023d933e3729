from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from midair.evaluate import TOUCHED, PalmFidelity, PressedPalm, perceptual_metrics
from midair.model import PressureFrames, Provenance
from midair.rig.correction.outcomes import Outcome, comparison_rows, next_step, palm_picture, summarise_outcomes
from midair.settings import Settings

PRESSED = PressedPalm(wanted=np.ones((9, 9)), delivered=np.full((9, 9), 2.0), pitch=5e-3, square=(15e-3, 15e-3))


def palm(outside):
    skins = MappingProxyType({"soft": 12.0, "stiff": 14.5})
    return PalmFidelity(outside=outside, pressure=9.0, square=11.0, displacement=skins, palm="mine", pressed=PRESSED)


def a_card():
    """Outcome of noise that was re-recorded almost without loss."""
    noise = 3 * np.random.default_rng(0).standard_normal((200, 4, 4))
    frames = PressureFrames(pressure=noise, rate=1000.0, band=(20.0, 470.0), provenance=Provenance(simulated=True))
    return perceptual_metrics(frames, replace(frames, pressure=1.02 * noise))


@pytest.fixture(scope="module")
def ways(loop):
    card = a_card()
    named = {"the best mode": 0.01, "the other": 0.95}
    return [Outcome(loop=loop, palm=palm(leak), card=card, name=name) for name, leak in named.items()]


def test_the_verdict_is_one_sentence_about_what_is_felt_in_each(ways):
    said = summarise_outcomes(ways)
    number = f"{ways[0].loop.passes[-1].comparison.ratios[TOUCHED][0]:.1f} dB"
    assert said.startswith("In the best mode a palm would feel it, ")
    assert (
        f"at {number} of signal to distortion on the touched cells and 1 % of the power beside the recorded square; "
        "in the other it would" in said
    )
    assert f"at {number} and 95 %; 20 to 40 Hz " in said
    assert said.endswith("from it; by a model of skin (simulated, not tried on people).")
    assert said.count("; ") == 3
    assert said.count(". ") == 0


def test_without_a_card_numbers_alone_are_told(ways):
    assert summarise_outcomes([replace(ways[0], card=None, name="", palm=None)]) == (
        f"{ways[0].distortion:.1f} dB of signal to distortion on the touched cells."
    )


def test_every_way_has_every_row(ways):
    rows = {name: (unit, values) for name, unit, *values in comparison_rows(ways)}
    assert set(ways[0].loop.passes[-1].comparison.ratios) <= set(rows)
    assert rows["leak: power beside the recorded square"] == ("%", ["1.0", "95.0"])
    assert rows["signal to distortion of the skin's movement"] == ("dB", ["12.0 to 14.5"] * 2)
    assert rows["solver, frames"][1][0] == f"lm, {ways[0].loop.passes[-1].reproduction.target.frames} at 1000 Hz"
    assert all(len(values) == 2 for _, values in rows.values())


@pytest.mark.long
def test_there_is_a_picture_where_there_is_a_palm(ways):
    assert palm_picture([replace(ways[0], palm=None)]) is None
    width, height = palm_picture(ways[:1]).size
    assert width > height > 100


def test_the_next_step_corrects_the_level(subtests):
    for gain, settings, said in [
        (0.806, Settings(), "0.81 of the original's pressure: solve with --gain 1.24"),
        (0.806, Settings().but(gain=1.24), "0.81 of the original's pressure: solve with --gain 1.54"),
        (1.44, Settings().but(strength=0.12), "1.44 of the original's pressure: solve with --strength 0.1"),
        (1.03, Settings(), ""),
        (-0.5, Settings(), ""),
        (0.5, None, ""),
    ]:
        with subtests.test(gain=gain):
            assert next_step(gain, settings) == said
