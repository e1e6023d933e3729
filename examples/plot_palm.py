"""
The whole palm
==============

A sensor's cells hear what presses on them. A palm feels what presses beside them as well, and moves as one. Noise on a
cell, solved as in the paper, with a guard, and with a quiet palm: the pressure of 20 to 470 Hz on a palm of 85 mm, and
how far four model skins move under it. Skins are flat models; nothing here was measured on people.
"""

import numpy as np

import midair
from midair.datasets import probe_signal
from midair.dsp import band_window, filter_response
from midair.figures import maps_figure
from midair.model import ControlGrid, Palm, SensorGrid, TransducerArray
from midair.physics import SKINS, SkinMotion, radiation_pressure
from midair.solvers import Guard

# %%
# A push that swings on one cell, a twelfth of a second of it, for control points over the sensor.

rate, array, palm = 1000.0, TransducerArray.autd3(columns=2, rows=2), Palm.disc(pitch=3e-3)
noise = probe_signal("noise", duration=0.08, rate=rate, sensor=SensorGrid())
push = midair.prepare(noise, mapping="constant-offset", interpolate="pressure", grid=ControlGrid(height=0.2))
loudest = 0.15 * midair.physics.focus_amplitude(push.grid, array) / push.amplitude.max()
target = midair.model.AmplitudeFrames(amplitude=loudest * push.amplitude, rate=rate, grid=push.grid)
solutions = {
    "as in the paper": midair.solve(target, array, method="fast"),
    "guard of 25 mm": midair.solve(target, array, method="fast", guard=Guard(margin=25e-3, pitch=6e-3)),
    "quiet palm": midair.solve(target, array, method="fast", quiet_palm=0.1),
}

# %%
# Pressure on the palm frame by frame, what of it is in the band, and its share outside the sensor's square of 55 mm.

grid, beyond = palm.grid(0.2), palm.beyond(27.5e-3, 27.5e-3)


def in_band(pressure):
    return filter_response(
        pressure, rate, lambda f: band_window(f, (20.0, 470.0), edges=(0.0, 0.0))[:, None, None], reach=0.1
    )


pressed = {}
for name, solution in solutions.items():
    field = midair.propagate(solution.drive, grid)
    pressure = in_band(radiation_pressure(field, midair.model.Medium()).reshape(-1, *palm.inside.shape))
    pressed[name] = pressure * palm.inside
    power = (pressed[name] ** 2).sum(axis=0)
    outside = 100 * power[beyond].sum() / power.sum()
    print(f"{name:16} E = {100 * solution.error.mean():4.1f} %; outside the square {outside:5.1f} %")

# %%
# Root mean square of the pressure: what flickers around the cells, and what the two ways leave of it.

figure = maps_figure(
    [(name, np.sqrt((each**2).mean(axis=0))) for name, each in pressed.items()],
    grid,
    quantity="pressure of 20 to 470 Hz (Pa, rms)",
    simulated=True,
    sensor=SensorGrid(),
)

# %%
# The same in skin. Waves carry what presses outside into the square and past the palm's edge.

for way in ("as in the paper", "quiet palm"):
    maps = []
    for name, tissue in SKINS.items():
        motion = SkinMotion.of(tissue, palm.inside.shape, pitch=palm.pitch, rate=rate)
        moved = 1e6 * motion.displacement(pressed[way])
        maps.append((f"{name}: {way}", np.sqrt((moved**2).mean(axis=0))))
    figure = maps_figure(maps, grid, quantity="displacement (µm, rms)", simulated=True, sensor=SensorGrid())

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_palm.png", dpi=130)
print("plot_palm.png")
