"""A sensor with faults, over LSL: 16 channels of noise in V and a counter. Run by tests; the argument is its name.

Channel 2 never changes, channel 5 reaches 2 V now and then, and of every 400 frames 10 are left out.
"""

import sys
import time

import numpy as np
import pylsl

name, rate = sys.argv[1], 1000
info = pylsl.StreamInfo(name, "tactile", 17, rate, pylsl.cf_float32, f"midair test {name}")
info.set_channel_units(["V"] * 17)
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
rng, begin, sent = np.random.default_rng(3), time.monotonic(), 0
while True:
    due = int((time.monotonic() - begin) * rate)
    frames = np.arange(sent, due)
    sent = due
    frames = frames[frames % 400 >= 10]
    if len(frames):
        values = 0.1 * rng.standard_normal((len(frames), 17))
        values[:, 2] = 0.0
        values[frames % 50 == 49, 5] = 2.0
        values[:, 16] = frames
        outlet.push_chunk(np.ascontiguousarray(values, np.float32))
    time.sleep(0.004)
