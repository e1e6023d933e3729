"""A simulated skin over LSL: 16 channels in Pa and a counter; arguments: its name, and its rate in Hz.

Channel 5 has 100 Hz of 20 Pa, the others zero. The last 20 of every 1000 frames are left out.
"""

import sys
import time

import numpy as np
import pylsl

info = pylsl.StreamInfo(sys.argv[1], "tactile", 17, 1000, pylsl.cf_float32, f"midair test {sys.argv[1]}")
info.set_channel_units(["Pa"] * 17)
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
rate = float(sys.argv[2]) if len(sys.argv) > 2 else 1000.0
begin, sent = time.monotonic(), 0
while True:
    due = int((time.monotonic() - begin) * rate)
    frames = np.arange(sent, due)
    sent = due
    frames = frames[frames % 1000 < 980]
    if len(frames):
        values = np.zeros((len(frames), 17))
        values[:, 5] = 20.0 * np.sin(2 * np.pi * 0.1 * frames)
        values[:, 16] = frames
        outlet.push_chunk(np.ascontiguousarray(values, np.float32))
    time.sleep(0.001)
