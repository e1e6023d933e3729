"""A program that plays 16 channels into JACK's dummy driver, or into the pipe of a PulseAudio source. Run by tests.

Arguments: jack or the pipe's path, rate in Hz, and what to play: ramp (channel c of frame i is ((i mod 2048) * 16 + c)
/ 32768) or tones (channel c is a sine of 60 + 25 c Hz, and one that aliases to 30 + 25 c Hz if every 48th frame is
taken without a filter).
"""

import os
import sys
import time

import numpy as np

where, rate, what = sys.argv[1], int(sys.argv[2]), sys.argv[3]
CHANNEL = np.arange(16)


def frames(begin, end):
    """Shape (frame, channel), float32."""
    number = np.arange(begin, end)[:, None]
    if what == "ramp":
        return np.asarray(((number % 2048) * 16 + CHANNEL) / 32768, np.float32)
    time_of = number / rate
    tone = np.sin(2 * np.pi * (60 + 25 * CHANNEL) * time_of) + np.sin(2 * np.pi * (9030 + 25 * CHANNEL) * time_of)
    return np.asarray(0.25 * tone, np.float32)


def connected(connect, error):
    """Result of `connect` once the server is available."""
    limit = time.monotonic() + 60
    while True:
        try:
            return connect()
        except error:
            if time.monotonic() > limit:
                raise
            time.sleep(0.05)


def to_jack():
    import jack

    jack.set_error_function(lambda _: None)
    client = connected(lambda: jack.Client("skin", no_start_server=True), jack.JackOpenError)
    ports = [client.outports.register(f"out_{channel}") for channel in CHANNEL]
    played = [0]

    @client.set_process_callback
    def process(count):
        block = frames(played[0], played[0] + count)
        for port, samples in zip(ports, block.T, strict=True):
            port.get_array()[:] = samples
        played[0] += count

    client.activate()
    print("ready", flush=True)
    time.sleep(600)


def to_pipe():
    pipe = os.open(where, os.O_WRONLY)
    print("ready", flush=True)
    begin, sent = time.monotonic(), 0
    while time.monotonic() - begin < 600:
        due = int((time.monotonic() - begin) * rate)
        if due - sent > rate / 2:  # no listener: continue from here, without a burst
            begin, due = begin + (due - sent) / rate, sent
        block = np.rint(frames(sent, due) * 32768).astype("<i2").tobytes()
        while block:
            block = block[os.write(pipe, block) :]
        sent = due
        time.sleep(0.01)


to_jack() if where == "jack" else to_pipe()
