"""
Quiet around the palm
=====================

The paper's error says nothing of the field outside the control points, and at low strength the loudest place is there.
Four ways to solve for the same weak target, looked at on a square of 120 mm. A ring that is kept quiet pushes the sound
further out; less drive makes less of it.
"""

import numpy as np

import midair
from midair.figures import maps_figure
from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.solvers import Guard

# %%
# Two opposite corners of the sensor, pressed by 4 Pa: a twentieth of the sound that a single focus of four units makes.

pressure = np.zeros((1, 4, 4))
pressure[0, 0, 0] = pressure[0, 3, 3] = 4.0
target = midair.prepare(PressureFrames(pressure=pressure, rate=1000.0), grid=ControlGrid(height=0.2))
array = TransducerArray.autd3(columns=2, rows=2)
wide = ControlGrid(rows=49, columns=49, pitch=2.5e-3, height=0.2)
away = np.abs(wide.position[:, :2]).max(axis=1)
ring = (away > 27.5e-3 + target.grid.pitch / 2) & (away < 47.5e-3)
beyond = away > 47.5e-3

# %%
# The paper's problem; with a guard ring of 20 mm around the square; with only as much drive as the target needs; and
# with both, each transducer free to be quieter.

guard = Guard(margin=20e-3)
solutions = {
    "all at full": midair.solve(target, array, method="fast"),
    "guard 20 mm": midair.solve(target, array, method="fast", guard=guard),
    "level auto": midair.solve(target, array, method="fast", level="auto"),
    "both, bounded": midair.solve(target, array, method="fast", guard=guard, level="auto", amplitudes="bounded"),
}
maps = []
for title, solution in solutions.items():
    field = np.abs(midair.propagate(solution.drive, wide)[0])
    near, far = (100 * field[where].max() / target.amplitude.max() for where in (ring, beyond))
    maps.append((title, field))
    print(f"{title:14} E = {100 * solution.error[0]:4.1f} %; loudest in the ring {near:3.0f} %, beyond {far:3.0f} %")

# %%
# One colour scale; the circles are the cells of the sensor.

figure = maps_figure(maps, wide, quantity="sound pressure (Pa, peak)", simulated=True, sensor=SensorGrid())

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_guard.png", dpi=130)
print("plot_guard.png")
