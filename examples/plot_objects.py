"""
Brush, sponge and towel
=======================

According to the paper (Fig. 9), these objects differ in the band above 300 Hz: it is strongest for the towel, followed
by the sponge and the brush. The synthetic strokes imitate this. Here they are recorded by the virtual sensor and
calibrated.
"""

import midair
from midair.figures import spectra_figure
from midair.rig import record
from midair.rig.names.sensor_names import VirtualRig

rig = VirtualRig(seed=1)
felt = {}
for name in ("brush", "towel", "sponge"):
    with rig.touched_by(name) as sensor:
        recording = record(sensor, duration=1.28).recording
    felt[name] = midair.calibrate(recording, sensor.calibration)

# %%
# Show the four channels under the path of the objects.

figure = spectra_figure({"": felt}, channels=(2, 6, 10, 14))

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_objects.png", dpi=130)
print("plot_objects.png")
