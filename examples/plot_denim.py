"""
A real fabric
=============

Denim under the finger of a robot, 16 taxels at 35.6 Hz, from the FabricSlide data set (MIT licence,
comes with midair). Its content lies below 20 Hz and nobody stated its sensitivity, so both the
band and the scale are stated here.
"""

import numpy as np

import midair
from midair.datasets import sample
from midair.figures import traces_figure
from midair.model import Calibration, ControlGrid, TransducerArray
from midair.pipeline import at_rate

recording = sample("denim")
print(f"{recording.frames} frames at {recording.rate:.2f} Hz, in {recording.unit}s")

# %%
# One count is called half a pascal.

calibration = Calibration.flat(recording.sensor, sensitivity=2.0, unit=recording.unit)
pressure = midair.calibrate(recording, calibration, band=(0.5, 15.0))
figure = traces_figure(pressure)

# %%
# A tenth of a second of it as sound, on a coarse grid.

part = at_rate(pressure, 200.0).cut(3.0, 0.1)
target = midair.prepare(part, grid=ControlGrid(rows=11, columns=11, pitch=5.5e-3))
solution = midair.solve(target, TransducerArray.autd3(), iterations=(30, 5))
print(f"E = {100 * np.mean(solution.error):.1f} % on average over {target.frames} frames")

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_denim.png", dpi=130)
print("plot_denim.png")
