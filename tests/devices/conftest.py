import time

import pytest

from midair.testing import UdpTap


@pytest.fixture
def attempts():
    """Attempts for a minute: a computer that others keep busy sends a frame late, and says so, but not for ever."""
    until = time.monotonic() + 60.0
    return iter(lambda: time.monotonic() < until, False)


@pytest.fixture
def tap(request):
    pytest.importorskip("autd3")
    one = UdpTap(getattr(request, "param", 1))
    yield one
    one.close()
