"""A JACK client "ears" that records its inputs. Run by tests.

Arguments: where to write what it heard, shape (frame, channel), once a line comes on its input.
"""

import sys
import time

import jack
import numpy as np

jack.set_error_function(lambda _: None)


def connected():
    limit = time.monotonic() + 60
    while True:
        try:
            return jack.Client("ears", no_start_server=True)
        except jack.JackOpenError:
            if time.monotonic() > limit:
                raise
            time.sleep(0.05)


client = connected()
ports = [client.inports.register(f"in_{channel}") for channel in range(2)]
heard = []


@client.set_process_callback
def process(_count):
    heard.append(np.array([port.get_array() for port in ports]).T)


client.activate()
print("ready", flush=True)
sys.stdin.readline()
client.deactivate()
np.save(sys.argv[1], np.concatenate(heard))
print("saved", flush=True)
