"""
Between two frames
==================

A transducer has a time constant of 188 µs. When its phase jumps, its amplitude drops to the cosine of half the
step. The drop repeats with every frame and is audible. A silencer spreads the step over time instead.
"""

import numpy as np

from midair.figures.style import STYLE, new_figure, plain_axes
from midair.model import Drive, TransducerArray
from midair.physics import PlaybackChain, TransducerDynamics, Transducers, radiate

one = TransducerArray(position=np.zeros((1, 3)), normal=np.array([[0.0, 0.0, 1.0]]))
still = Transducers.alike(1, TransducerDynamics(detuning=0.0))
STEPS = 2000


def after(step, ramp=0.0):
    """Amplitude and phase during the first millisecond after a phase step of `step` rad."""
    phase = np.repeat([0.0, step], [10, 1])[:, None]
    drive = Drive(phase=phase, level=np.ones(11), rate=1000.0, array=one)
    chain = PlaybackChain(phase_bits=None, phase_ramp=ramp, transducers=still, precision="double")
    return np.concatenate([q for q, _ in radiate(drive, chain, STEPS)])[-STEPS:, 0]


# %%
# The columns: minimum amplitude and mean intensity over a frame of 1 ms.

print(f"{'step':>8}{'least |q|':>12}{'cos(step/2)':>13}{'mean |q|^2':>12}{'least, 0.25 ms ramp':>21}")
for degrees in (45, 90, 180):
    q, spread = after(np.radians(degrees)), after(np.radians(min(degrees, 179.9)), ramp=0.25e-3)
    print(
        f"{degrees:>5} deg{np.abs(q).min():12.3f}{np.cos(np.radians(degrees / 2)):13.3f}"
        f"{np.mean(np.abs(q) ** 2):12.3f}{np.abs(spread).min():21.3f}"
    )

# %%
# Plot the drops of the amplitude.
figure = new_figure(7.0, 2.8, simulated=True)
time = np.arange(1, STEPS + 1) / STEPS
for axes, ramp in zip(figure.subplots(1, 2, sharey=True), (0.0, 0.25e-3), strict=True):
    plain_axes(axes)
    for degrees, line in ((45, ":"), (90, "--"), (179.9, "-")):
        axes.plot(time, np.abs(after(np.radians(degrees), ramp)), line, color=STYLE.reproduced, label=f"{degrees:.0f}°")
    axes.set_title("at once" if ramp == 0 else "spread over 0.25 ms", fontsize=9, loc="left")
    axes.set_xlabel("time after the step (ms)", fontsize=8)
    axes.set_ylim(0, 1.05)
figure.axes[0].set_ylabel("amplitude over full drive", fontsize=8)
figure.axes[0].legend(title="phase step", fontsize=8, title_fontsize=8, frameon=False, loc="lower right")

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_phase_step.png", dpi=130)
print("plot_phase_step.png")
