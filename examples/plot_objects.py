"""
Brush, sponge and towel
=======================

What tells them apart is the band above 300 Hz, says the paper (Fig. 9): strongest in the towel, then the sponge, then
the brush. The synthetic strokes are made so; here they go through the virtual sensor and its calibration.
"""

import midair
from midair.figures import spectra_figure
from midair.rig.names.virtual_rig import VirtualRig
from midair.rig.takes.capture import capture_recording

rig = VirtualRig(seed=1)
felt = []
for name in ("brush", "towel", "sponge"):
    with rig.touched_by(name) as sensor:
        recording = capture_recording(sensor, duration=1.28)
    felt.append((name, midair.calibrate(recording, sensor.calibration)))

# %%
# The four channels that the objects pass over.

figure = spectra_figure(felt, channels=(2, 6, 10, 14))

# %%
# Run as a script, it leaves the picture in the folder that it is run from.

figure.savefig("plot_objects.png", dpi=130)
print("plot_objects.png")
