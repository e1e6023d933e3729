"""
One channel becomes a field
===========================

Most tactile libraries hold one waveform per surface. The file does not contain position and size of the contact. This
example sets both, and computes the pressure on 4 x 4 cells.
"""

import numpy as np

import midair
from midair.datasets import sample
from midair.figures import maps_figure, traces_figure
from midair.model import Recording, SensorGrid
from midair.recordings import edit
from midair.recordings.footprint import Footprint, covered, footprint_field

# %%
# The waveform is from one taxel of a robot finger on denim, at 1 kHz. One count is taken as half a pascal.

denim = edit.resample(sample("denim"), 1000.0)
wave = edit.cut(denim, 4.0, 5.64).samples[:, 1, 1]
wave = 0.5 * (wave - np.median(wave))
one = SensorGrid(rows=1, columns=1)
mono = Recording(samples=wave[:, None, None], rate=1000.0, sensor=one, unit="Pa", provenance=denim.provenance)

# %%
# A disc of 20 mm moves over the cells at 50 mm/s. The pressure on a cell is the waveform times the covered share of the
# cell.

footprint = Footprint(shape="circle", size=20e-3, speed=50e-3, path="diagonal")
field = footprint_field(mono, footprint)
times = np.array([0.3, 0.6, 0.82, 1.1])
shares = covered(footprint, field.sensor, times)
shown = [(f"{time:g} s", share) for time, share in zip(times, shares, strict=True)]
print(f"the disc crosses the sensor in {footprint.crossing(field.sensor):.2f} s")
share_figure = maps_figure(shown, field.sensor, quantity="share of the cell that is covered", simulated=True)

# %%
# The positions were not measured, so all results are marked as simulated.

figure = traces_figure(midair.calibrate(field, band=(0.8, 15.0)))

# %%
# As a script, the example saves the picture in the current folder.

figure.savefig("plot_footprint.png", dpi=130)
print("plot_footprint.png")
