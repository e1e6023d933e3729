"""Live touch of a recording, one frame after another: the causal inverse, the mapping, the live solver, the bytes.

`midair live` runs by the clock, so no two of its runs are alike. These two classes are not public: this is the only
place of the recorder that follows when they are renamed.
"""

import numpy as np

import midair
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.touch import Touch

take = midair.record("virtual:towel", 0.6)
frames = take.recording.samples[350:550].reshape(200, -1)
for mapping, offset in (("half-wave", None), ("constant-offset", 5.0), ("slow-bias", None)):
    touch = Touch(
        LiveSettings(mapping=mapping, offset=offset),
        take.calibration,
        take.recording.sensor,
        take.recording.rate,
        midair.TransducerArray.autd3(),
        1.0,
    )
    pressure, phases, sounds = [], [], []
    for number, frame in enumerate(frames):
        touch.feel(frame)
        sounds.append(touch.form(hurried=number % 10 == 9))
        pressure.append(touch.pressure.copy())
        phases.append(touch.phases.copy())
    print(mapping, sum(sounds), touch.delay, *touch.error)
    np.savez(f"live-{mapping}.npz", pressure=pressure, phases=phases, sounds=sounds)
