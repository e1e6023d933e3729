"""
Quiet around the palm
=====================

The paper's error does not include the field outside the control points, where the sound is loudest at low strength.
This example solves the same weak target in four ways and shows the field on a square of 120 mm. A quiet ring moves the
sound further out; a lower drive level reduces it.
"""

import numpy as np

import midair
from midair.figures import maps_figure
from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.solvers import Guard

# %%
# Two opposite corners of the sensor with 4 Pa each: a twentieth of the sound pressure of a single focus of four units.

pressure = np.zeros((1, 4, 4))
pressure[0, 0, 0] = pressure[0, 3, 3] = 4.0
target = midair.prepare(PressureFrames(pressure=pressure, rate=1000.0), mapping="half-wave")
array = TransducerArray.autd3(columns=2, rows=2)
wide = ControlGrid(rows=49, columns=49, pitch=2.5e-3, height=0.2)
away = np.abs(wide.position[:, :2]).max(axis=1)
ring = (away > 27.5e-3 + target.grid.pitch / 2) & (away < 47.5e-3)
beyond = away > 47.5e-3

# %%
# The four ways: the paper's problem; a guard ring of 20 mm around the square; the lowest drive level for the target;
# and both together with a separate amplitude for each transducer.

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
# All maps have the same colour scale; the circles are the cells of the sensor.

figure = maps_figure(maps, wide, quantity="sound pressure (Pa, peak)", simulated=True, sensor=SensorGrid())

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_guard.png", dpi=130)
print("plot_guard.png")
