"""Simulated devices and helpers for tests of programs that use midair."""

from midair.testing.exposure_override import clear_any_exposure
from midair.testing.grbl_simulator import GrblSimulator, PlannedMove
from midair.testing.openmpd_simulator import OpenMpdSimulator, PinFrame, measured_board
from midair.testing.udp_proxy import UdpProxy

__all__ = [
    "GrblSimulator",
    "OpenMpdSimulator",
    "PinFrame",
    "PlannedMove",
    "UdpProxy",
    "measured_board",
    "clear_any_exposure",
]
