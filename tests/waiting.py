import time


class Clock:
    """A clock that stands still until it is set."""

    def __init__(self, now):
        self.now = now

    def __call__(self):
        return self.now


def wait_until(true, limit=60.0):
    """Wait until a function returns a true value, and return that."""
    end = time.monotonic() + limit
    while not (found := true()):
        assert time.monotonic() < end, f"it did not come in {limit:g} s"
        time.sleep(0.005)
    return found
