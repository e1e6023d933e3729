import time


def wait_until(true, limit=60.0):
    """Wait until a function returns a true value, and return that."""
    end = time.monotonic() + limit
    while not (found := true()):
        assert time.monotonic() < end, f"it did not come in {limit:g} s"
        time.sleep(0.005)
    return found
