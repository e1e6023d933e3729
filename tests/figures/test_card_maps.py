"""A perceptual card as maps."""

import pytest

from midair.evaluate import perceptual_metrics
from midair.figures import card_figure


@pytest.mark.parametrize("simulated", [True, False])
def test_maps_with_units(tones, check_figure, simulated):
    card = perceptual_metrics(tones(simulated=simulated), tones(0.5, simulated=simulated))
    check_figure(card_figure(card), "dB", "ST-SIM", "SPQI", simulated=simulated)


def test_the_card_s_map_holds_its_numbers(tones):
    card = perceptual_metrics(tones(), tones(0.5))
    texts = {text.get_text() for axis in card_figure(card).axes for text in axis.texts}
    assert f"{card.figure('ST-SIM').channels[0, 2]:.2f}" in texts
    assert "–" in texts
