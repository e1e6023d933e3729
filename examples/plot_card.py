"""
Effect of rectification on touch
================================

Radiation pressure is never negative, so the paper removes the negative half of the pressure. A slow bias shifts the
pressure instead. This example compares both mappings with perceptual metrics, with an otherwise perfect reproduction.
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
    print(f"{name}: signal to distortion {found.distortion_ratio:.1f} dB, gain {found.gain:.2f}")
    heard = replace(felt, pressure=in_band(pushed.pressure, felt.rate, (20.0, 470.0)) / found.gain)
    cards[name] = perceptual_metrics(felt, heard)

# %%
# Both are compared at the same strength in the band; the metrics differ in their results.

for name, card in cards.items():
    print(name)
    for each in card.figures:
        print(f"  {each.name}: {each.overall:.3g} {each.unit}")

# %%
# The metrics of each cell after half-wave rectification; one cell was touched.

figure = card_figure(cards["half-wave"])

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_card.png", dpi=130)
print("plot_card.png")
