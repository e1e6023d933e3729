"""The figures of budgets, cards, loops, and the paper's own: units on their axes, SIMULATED where it is."""

import numpy as np
import pytest

from midair.evaluate import Leak, StageOutput, budget, perceptual_card
from midair.figures import budget_figure, card_figure, passes_figure, png
from midair.figures.paper_figures import FieldRow, fields_figure, objects_figure, stimuli_figure
from midair.model import ControlGrid, PressureFrames, Provenance, SensorGrid


def frames(factor=1.0, simulated=True, rate=2000.0):
    time = np.arange(1000) / rate
    pressure = np.zeros((1000, 16))
    pressure[:, 2] = factor * 10 * np.sin(2 * np.pi * 100 * time) + np.sin(2 * np.pi * 300 * time)
    return PressureFrames(pressure=pressure.reshape(-1, 4, 4), rate=rate, provenance=Provenance(simulated=simulated))


def made(simulated=True):
    leak = Leak(peak=0.5, typical=0.2, place=(0.0, 0.0), wanted=1.0)
    outputs = [StageOutput(name="one", what="", pressure=frames(0.9, simulated), leak=leak)]
    return budget(frames(simulated=simulated), outputs, strength=0.1)


FIGURES = {
    "budget": lambda: budget_figure([("paper", made()), ("best", made())]),
    "card": lambda: card_figure(perceptual_card(frames(), frames(0.5))),
    "passes": lambda: passes_figure([("noise", [0.5, 0.3, 0.2])], simulated=True),
    "fields": lambda: fields_figure(
        [FieldRow(name="target", fields=np.ones((2, 256)), grid=ControlGrid(), notes=("a", "b"))],
        SensorGrid(),
        quantity="sound pressure (Pa)",
    ),
    "stimuli": lambda: stimuli_figure({"i": {"original": frames(), "paper mode": frames(0.5)}}),
    "objects": lambda: objects_figure({"plain": {"towel": frames(), "brush": frames(0.5)}}),
}


def words(figure):
    texts = [text.get_text() for text in figure.texts]
    for axis in figure.axes:
        texts += [axis.get_xlabel(), axis.get_ylabel(), axis.get_title(loc="left"), axis.get_title()]
    return " ".join([*texts, figure.get_supxlabel(), figure.get_supylabel()])


@pytest.mark.parametrize("name", FIGURES)
def test_says_simulated_and_becomes_a_picture(name):
    figure = FIGURES[name]()
    assert "SIMULATED" in words(figure)
    assert png(figure, dpi=40).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("budget", ["(dB)", "Hz"]),
        ("passes", ["(%)", "pass"]),
        ("fields", ["(mm)", "(Pa)"]),
        ("stimuli", ["(ms)", "(Pa)"]),
        ("objects", ["(Hz)", "dB re 1 Pa²/Hz"]),
        ("card", ["dB"]),
    ],
)
def test_axes_have_units(name, units):
    said = words(FIGURES[name]())
    assert all(unit in said for unit in units)


def test_what_is_measured_does_not_say_simulated():
    assert "SIMULATED" not in words(budget_figure([("real", made(simulated=False))]))


def test_the_card_s_map_holds_its_numbers():
    card = perceptual_card(frames(), frames(0.5))
    texts = {text.get_text() for axis in card_figure(card).axes for text in axis.texts}
    assert f"{card.figure('ST-SIM').channels[0, 2]:.2f}" in texts
    assert "–" in texts
