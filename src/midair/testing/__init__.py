"""Simulated devices and helpers for tests of programs that use midair."""

from .exposure_override import clear_any_exposure as clear_any_exposure
from .grbl_simulator import GrblSimulator as GrblSimulator
from .grbl_simulator import PlannedMove as PlannedMove
from .openmpd_simulator import OpenMpdSimulator as OpenMpdSimulator
from .openmpd_simulator import PinFrame as PinFrame
from .openmpd_simulator import measured_board as measured_board
from .udp_proxy import UdpProxy as UdpProxy
