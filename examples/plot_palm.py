"""
The whole palm
==============

The cells of a sensor measure the pressure on them. A palm also feels pressure beside them, and its skin moves as a
whole. This example solves noise on a cell as in the paper, with a guard, and with a quiet palm, and shows the pressure
of 20 to 470 Hz on a palm of 85 mm and the displacement of four skin models. The skins are flat models; there are no
measurements on people.
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
# The target is a varying pressure on one cell for a twelfth of a second, on control points over the sensor.

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
# Compute the pressure on the palm frame by frame, its part in the band, and the share of its power outside the sensor's
# square of 55 mm.

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
# The maps show the rms pressure: the vibration around the cells, and how much of it both methods leave.

figure = maps_figure(
    [(name, np.sqrt((each**2).mean(axis=0))) for name, each in pressed.items()],
    grid,
    quantity="pressure of 20 to 470 Hz (Pa, rms)",
    simulated=True,
    sensor=SensorGrid(),
)

# %%
# The maps show the displacement of the skin. Waves spread the pressure outside into the square and to the palm's edge.

for way in ("as in the paper", "quiet palm"):
    maps = []
    for name, tissue in SKINS.items():
        motion = SkinMotion.of(tissue, palm.inside.shape, pitch=palm.pitch, rate=rate)
        moved = 1e6 * motion.displacement(pressed[way])
        maps.append((f"{name}: {way}", np.sqrt((moved**2).mean(axis=0))))
    figure = maps_figure(maps, grid, quantity="displacement (µm, rms)", simulated=True, sensor=SensorGrid())

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_palm.png", dpi=130)
print("plot_palm.png")
