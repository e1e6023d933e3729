"""
A real fabric
=============

A robot finger with 16 taxels at 35.6 Hz slides over denim; the recording is from the FabricSlide data set (MIT licence,
included in midair). Its content is below 20 Hz and its sensitivity is unknown, so this example sets the band and the
scale.
"""

import numpy as np

import midair
from midair.datasets import sample
from midair.figures import traces_figure
from midair.model import Calibration, ControlGrid, TransducerArray
from midair.pipeline import resample_pressure

recording = sample("denim")
print(f"{recording.frames} frames at {recording.rate:.2f} Hz, in {recording.unit}s")

# %%
# One count is taken as half a pascal.

calibration = Calibration.flat(recording.sensor, sensitivity=2.0, unit=recording.unit)
pressure = midair.calibrate(recording, calibration, band=(0.5, 15.0))
figure = traces_figure(pressure)

# %%
# Solve a tenth of a second on a coarse grid.

part = resample_pressure(pressure, 200.0).cut(3.0, 0.1)
target = midair.prepare(part, mapping="half-wave", grid=ControlGrid(rows=11, columns=11, pitch=5.5e-3))
solution = midair.solve(target, TransducerArray.autd3(), method="lm", iterations=(30, 5))
print(f"E = {100 * np.mean(solution.error):.1f} % on average over {target.frames} frames")

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_denim.png", dpi=130)
print("plot_denim.png")
