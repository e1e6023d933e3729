"""
A pattern in midair
===================

Two opposite corners of the sensor are pressed at once. This example solves the pattern as a field of ultrasound 200 mm
above four AUTD3 units, similar to the targets in the paper's Fig. 3.
"""

import numpy as np

import midair
from midair.figures import maps_figure
from midair.model import PressureFrames, SensorGrid, TransducerArray

# %%
# The target is a pressure on 4 x 4 cells; `prepare` converts it to sound amplitudes at 16 x 16 points.

pressure = np.zeros((1, 4, 4))
pressure[0, 0, 0] = pressure[0, 3, 3] = 20.0
target = midair.prepare(PressureFrames(pressure=pressure, rate=1000.0), mapping="half-wave")

# %%
# The paper's Levenberg-Marquardt method finds phases for 996 transducers of equal amplitude.

array = TransducerArray.autd3(columns=2, rows=2)
solution = midair.solve(target, array, method="lm")
field = np.abs(midair.propagate(solution.drive, target.grid))
print(f"E = {100 * solution.error[0]:.1f} % after {solution.iterations[0]} iterations ({solution.status[0]})")

# %%
# Both maps have the same colour scale; the circles are the cells of the sensor.

figure = maps_figure(
    [("target", target.amplitude[0]), ("reproduced", field[0])],
    target.grid,
    quantity="sound pressure (Pa, peak)",
    simulated=True,
    sensor=SensorGrid(),
)

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_pattern.png", dpi=130)
print("plot_pattern.png")
