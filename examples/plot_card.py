"""
What rectification does to touch
================================

Sound can only push, so the paper cuts off the half of the pressure that pulls. A slow bias lifts it instead. What would
skin make of the two, if everything else were perfect?
"""

from dataclasses import replace

from midair.datasets import probe_signal
from midair.evaluate import fidelity, in_band, perceptual_metrics
from midair.figures import card_figure
from midair.targets import MAPPINGS

felt = probe_signal("noise", duration=0.3, rate=4000.0)

cards = {}
for name in ("half-wave", "slow-bias"):
    pushed = replace(felt, pressure=MAPPINGS[name](felt.pressure, felt.rate))
    found = fidelity(felt, pushed)
    print(f"{name}: {found.distortion_ratio:.1f} dB of signal over distortion, gain {found.gain:.2f}")
    heard = replace(felt, pressure=in_band(pushed.pressure, felt.rate, (20.0, 470.0)) / found.gain)
    cards[name] = perceptual_metrics(felt, heard)

# %%
# At the same strength in the band, each number of the card has its own answer.

for name, card in cards.items():
    print(name)
    for each in card.figures:
        print(f"  {each.name}: {each.overall:.3g} {each.unit}")

# %%
# Cell by cell, after half-wave rectification: one cell was touched.

figure = card_figure(cards["half-wave"])

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_card.png", dpi=130)
print("plot_card.png")
