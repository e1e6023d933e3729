"""For tests of programs that use midair: fakes and builders, as midair's own tests use them."""

from midair.testing.overriding import overridden
from midair.testing.udp_tap import UdpTap

__all__ = ["UdpTap", "overridden"]
