"""The Python example of the README, with every figure in full."""

import numpy as np

import midair

take = midair.record("virtual:towel", 1.0)
pressure = midair.calibrate(take.recording, take.calibration).cut(0.4, 0.1)
target = midair.prepare(pressure)
solution = midair.solve(target, midair.TransducerArray.autd3())
with midair.open_rig("virtual") as rig:
    played = midair.play(solution, rig)
heard = midair.calibrate(played.take.recording, played.take.calibration)
close = midair.compare(pressure, played)
print(solution.error.mean(), close.correlation, close.gain)
field = midair.propagate(solution.drive, target.grid)
np.savez(
    "readme.npz",
    pressure=pressure.pressure,
    target=target.amplitude,
    phase=solution.drive.phase,
    level=solution.drive.level,
    error=solution.error,
    field=field,
    heard=heard.pressure,
)
