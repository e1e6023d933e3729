"""Phased arrays: AUTD3 through both of its SDKs, OpenMPD boards, and the transmission of frames."""

from midair.devices.arrays.autd3 import (
    autd3_array,
    autd3_constant_frame,
    autd3_firmware,
    autd3_immediate,
    pyautd3_array,
)
from midair.devices.arrays.banked_array import BankedArray
from midair.devices.arrays.immediate import ImmediateArray, ImmediateUnits, Put
from midair.devices.arrays.openmpd import OpenMpdArray
from midair.devices.arrays.silencer import Silencer, SilencerChoice, choose_silencer

__all__ = [
    "BankedArray",
    "ImmediateArray",
    "ImmediateUnits",
    "OpenMpdArray",
    "Put",
    "Silencer",
    "SilencerChoice",
    "autd3_array",
    "autd3_firmware",
    "autd3_immediate",
    "autd3_constant_frame",
    "choose_silencer",
    "pyautd3_array",
]
