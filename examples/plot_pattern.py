"""
A pattern in midair
===================

Two opposite corners of the sensor pressed at once, as a field of ultrasound 200 mm above four AUTD3 units: the kind of
target of the paper's Fig. 3.
"""

import numpy as np

import midair
from midair.figures import maps_figure
from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray

# %%
# A target is pressure on 4 x 4 cells; preparing it gives sound amplitude at 16 x 16 points.

pressure = np.zeros((1, 4, 4))
pressure[0, 0, 0] = pressure[0, 3, 3] = 20.0
target = midair.prepare(PressureFrames(pressure=pressure, rate=1000.0), grid=ControlGrid(height=0.2))

# %%
# The paper's Levenberg-Marquardt finds phases for 996 equally loud transducers.

array = TransducerArray.autd3(columns=2, rows=2)
solution = midair.solve(target, array, method="lm")
field = np.abs(midair.propagate(solution.drive, target.grid))
print(f"E = {100 * solution.error[0]:.1f} % after {solution.iterations[0]} iterations ({solution.status[0]})")

# %%
# Both maps have one colour scale; the circles are the cells of the sensor.

figure = maps_figure(
    [("target", target.amplitude[0]), ("reproduced", field[0])],
    target.grid,
    quantity="sound pressure (Pa, peak)",
    simulated=True,
    sensor=SensorGrid(),
)

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_pattern.png", dpi=130)
print("plot_pattern.png")
