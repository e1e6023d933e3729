"""Files of other programs that later rows bring in."""

from pathlib import Path

import numpy as np
import soundfile

Path("takes").mkdir()
rng = np.random.default_rng(0)
time = np.arange(200) / 100
fabric = np.column_stack([time, np.sin(2 * np.pi * 30 * time)])
np.savetxt("fabric.csv", fabric, delimiter=",", header="time,accel_x", comments="")
gaps = rng.normal(size=(1000, 4, 4))
gaps[500:504, 1, 1] = np.nan
np.save("sensor.npy", gaps)
soundfile.write("towel.wav", rng.uniform(-1, 1, 500), 1000)
rng.normal(size=64_000)  # the numbers below stay as they were in earlier records
rows = [
    f"p{person},{shown},{surface},{asked},{rng.integers(1, 8)}"
    for person in range(6)
    for surface in ("plain", "grooved")
    for shown in ("brush", "towel", "sponge")
    for asked in ("brush", "towel")
]
Path("old.csv").write_text("\n".join(["subject,presented,surface,rated,score", *rows]) + "\n", encoding="utf-8")
outline = [[-40, -45], [40, -45], [45, 20], [30, 50], [-35, 50]]
Path("palm.toml").write_text(f'name = "left hand"\noutline_mm = {outline}\n', encoding="utf-8")
sway = [f"{each},{0.01 * each},0,0.2,0,0,-1,0,1,0,1" for each in np.arange(60) / 100]
Path("hand.csv").write_text("\n".join(["time,x,y,z,nx,ny,nz,dx,dy,dz,confidence", *sway]) + "\n", encoding="utf-8")
