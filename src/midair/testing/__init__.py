"""Simulated devices and helpers for tests of programs that use midair."""

from midair.testing.grbl_stand_in import GrblStandIn, PlannedMove
from midair.testing.openmpd_stand_in import OpenMpdStandIn, PinFrame, measured_board
from midair.testing.overriding import overridden
from midair.testing.udp_tap import UdpTap

__all__ = ["GrblStandIn", "OpenMpdStandIn", "PinFrame", "PlannedMove", "UdpTap", "measured_board", "overridden"]
