import time

import pytest
from tests.simulators.udp_proxy import UdpProxy


@pytest.fixture
def attempts():
    """Attempts within a minute: on a busy computer a frame may be late, which is reported, but not forever."""
    until = time.monotonic() + 60.0
    return iter(lambda: time.monotonic() < until, False)


@pytest.fixture
def tap(request):
    pytest.importorskip("autd3")
    one = UdpProxy(getattr(request, "param", 1))
    yield one
    one.close()
