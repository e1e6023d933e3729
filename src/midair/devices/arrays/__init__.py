"""Phased arrays: AUTD3 by both of its SDKs, how frames reach them, and the gate before any sound."""

from midair.devices.arrays.autd3 import autd3_array, autd3_firmware, pyautd3_array
from midair.devices.arrays.banked_array import BankedArray
from midair.devices.arrays.frame_bytes import amplitude_of, intensity_bytes, phase_bytes
from midair.devices.arrays.gate import DEFAULT_PROFILE, Admission, admit, profile_named
from midair.devices.arrays.placement import Placement, load_placement
from midair.devices.arrays.silencer import Silencer, SilencerChoice, choose_silencer

__all__ = [
    "Admission",
    "BankedArray",
    "DEFAULT_PROFILE",
    "Placement",
    "Silencer",
    "SilencerChoice",
    "admit",
    "amplitude_of",
    "autd3_array",
    "autd3_firmware",
    "choose_silencer",
    "intensity_bytes",
    "load_placement",
    "phase_bytes",
    "profile_named",
    "pyautd3_array",
]
