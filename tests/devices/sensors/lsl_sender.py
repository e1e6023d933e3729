"""A program that sends frames of 16 channels over LSL: channel c of frame i is (i mod 2048) * 16 + c. Run by tests.

Arguments: name, unit of the channels (or -), frames to leave out before every 200th, the frame before which 100 are
left out, where the counter in channel 16 begins, and whether frames have the stamps that liblsl gives them ("cast"), or
those of when they were due ("stamped"), from that frame on three seconds earlier and none left out ("back").
"""

import sys
import time

import numpy as np
import pylsl

name, unit, how = sys.argv[1], sys.argv[2], sys.argv[6]
hole, once, base = map(int, sys.argv[3:6])
rate = 1000.0
info = pylsl.StreamInfo(name, "tactile", 17, rate, pylsl.cf_float32, f"midair test {name}")
if unit != "-":
    info.set_channel_units([unit] * 17)
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
outlet.wait_for_consumers(30)
first_stamp = pylsl.local_clock()
begin, sent = time.monotonic(), 0
while True:
    due = int((time.monotonic() - begin) * rate)
    frames = np.arange(sent, due)
    sent = max(sent, due)
    left_out = (frames >= once - 100) & (frames < once) & (how != "back")
    frames = frames[(frames % 200 >= hole) & ~left_out]
    if len(frames):
        values = (frames[:, None] % 2048) * 16 + np.arange(17)
        values[:, 16] = frames + base
        due_at = first_stamp + frames / rate - 3 * ((frames >= once) & (how == "back"))
        stamps = list(due_at) if how in ("stamped", "back") else 0.0
        outlet.push_chunk(np.ascontiguousarray(values, np.float32), stamps)
    time.sleep(0.004)
