"""Phased arrays: AUTD3 through both of its SDKs, and the transmission of frames."""

from .autd3 import autd3_array as autd3_array
from .autd3 import autd3_immediate as autd3_immediate
from .autd3 import pyautd3_array as pyautd3_array
from .immediate import OUTCOMES as OUTCOMES
from .immediate import ImmediateArray as ImmediateArray
from .immediate import ImmediateUnits as ImmediateUnits
from .immediate import Put as Put
from .silencer import Silencer as Silencer
from .silencer import SilencerChoice as SilencerChoice
from .silencer import silencer_named as silencer_named
from .streaming import BankedArray as BankedArray
