"""
Mappings to positive pressure
=============================

Radiation pressure is never negative. The paper removes the negative pressure (half-wave). This example applies the
three mappings that keep the waveform to three signals at 4 kHz, and compares the remaining signal in 20-470 Hz and the
costs.
"""

import numpy as np

from midair.dsp import band_window, filter_response
from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import PressureFrames, Provenance
from midair.targets import MAPPINGS

RATE, DURATION = 4000.0, 4.0
NAMES = ("half-wave", "constant-offset", "slow-bias")
time = np.arange(int(DURATION * RATE)) / RATE
rng = np.random.default_rng(0)


def in_band(x):
    return filter_response(x, RATE, lambda f: band_window(f, (20.0, 470.0), edges=(10.0, 23.5)), reach=0.2)


# %%
# Each signal begins and ends at rest, because a step of the bias would be felt.

burst = np.clip(((time - 0.3) % 0.5) / 0.15, 0, 1)
rest = np.clip(np.minimum(time - 0.1, DURATION - 0.1 - time) / 0.1, 0, 1)
noise = rng.standard_normal(len(time))
signals = {
    "25 + 250 Hz": 0.6 * np.sin(2 * np.pi * 25 * time) + 0.4 * np.sin(2 * np.pi * 250 * time),
    "noise": in_band(noise),
    "bursts": in_band(noise * (1 - np.cos(2 * np.pi * burst)) / 2),
}
signals = {name: x * (1 - np.cos(np.pi * rest)) / 2 for name, x in signals.items()}


def frames(x):
    pressure = np.zeros((len(x), 4, 4))
    pressure[:, 1, 1] = 20 * x / np.abs(x).max()
    return PressureFrames(pressure=pressure, rate=RATE, provenance=Provenance(source="example", simulated=True))


# %%
# The columns: gain and signal-to-distortion ratio of the wanted part, its rms over the highest pressure, mean over peak
# of the pressure, and the change of the mean sound energy for the same wanted part.


def gain_of(wanted, got):
    return (wanted * got).sum() / (wanted**2).sum()


def decibels(signal, rest):
    return 10 * np.log10(signal / rest) if rest > 0 else np.inf


print(f"{'':14}{'':18}{'gain':>6}{'SDR dB':>8}{'wanted/peak':>13}{'mean/peak':>11}{'energy dB':>11}{'on':>6}")
for signal, x in signals.items():
    x = frames(x).pressure[:, 1, 1]
    wanted = in_band(x)
    cut = MAPPINGS["half-wave"](x[:, None], RATE)[:, 0]
    for name in NAMES:
        pushed = MAPPINGS[name](x[:, None], RATE)[:, 0]
        got = in_band(pushed)
        gain, peak = gain_of(wanted, got), pushed.max()
        distortion = decibels(gain**2 * (wanted**2).sum(), ((got - gain * wanted) ** 2).sum())
        # The half-wave mapping keeps half of the wanted part, so it needs twice the pressure for the same.
        energy = decibels(pushed.sum() * gain_of(wanted, in_band(cut)), cut.sum() * gain)
        print(
            f"{signal:14}{name:18}{gain:6.2f}{distortion:8.1f}{gain * wanted.std() / peak:13.3f}"
            f"{pushed.mean() / peak:11.2f}{energy:11.1f}{(pushed > 0).mean():6.2f}"
        )

# %%
# Show a part of the bursts.
figure = new_figure(7.0, 5.0, simulated=True)
part = slice(int(0.65 * RATE), int(1.15 * RATE))
for axes, mapping in zip(figure.subplots(3, 1, sharex=True, sharey=True), NAMES, strict=True):
    x = frames(signals["bursts"]).pressure
    pushed = MAPPINGS[mapping](x, RATE)
    plain_axes(axes)
    axes.plot(1e3 * time[part], x[part, 1, 1], color=STYLE.before, linewidth=0.8, label="recorded")
    axes.plot(1e3 * time[part], pushed[part, 1, 1], color=STYLE.reproduced, linewidth=0.8, label="pushed")
    axes.set_title(mapping, fontsize=9, loc="left")
    axes.set_ylabel("pressure (Pa)", fontsize=8)
axes.set_xlabel("time (ms)", fontsize=8)
figure.axes[0].legend(fontsize=8, frameon=False, loc="upper right")

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_mappings.png", dpi=130)
print("plot_mappings.png")
