"""A program that sends frames of 16 channels over LSL: channel c of frame i is (i mod 2048) * 16 + c. Run by tests.

Arguments: name, rate in Hz, seconds, unit of the channels (or -), frames to leave out before every 200th.
"""

import sys
import time

import numpy as np
import pylsl

name, rate, seconds, unit, hole = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4], int(sys.argv[5])
info = pylsl.StreamInfo(name, "tactile", 17, rate, pylsl.cf_float32, f"midair test {name}")
if unit != "-":
    info.set_channel_units([unit] * 17)
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
outlet.wait_for_consumers(30)
begin, sent = time.monotonic(), 0
while sent < seconds * rate:
    due = int((time.monotonic() - begin) * rate)
    frames = np.arange(sent, due)
    sent = max(sent, due)
    frames = frames[frames % 200 >= hole]
    if len(frames):
        values = (frames[:, None] % 2048) * 16 + np.arange(17)
        values[:, 16] = frames
        outlet.push_chunk(np.ascontiguousarray(values, np.float32))
    time.sleep(0.004)
time.sleep(1.0)
