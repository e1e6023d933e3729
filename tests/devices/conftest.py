import pytest

from midair.testing import UdpTap


@pytest.fixture
def tap(request):
    pytest.importorskip("autd3")
    one = UdpTap(getattr(request, "param", 1))
    yield one
    one.close()
