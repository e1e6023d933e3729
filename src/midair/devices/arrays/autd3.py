"""Constructors of AUTD3 arrays for each SDK; an SDK is imported only when a device opens."""

import importlib
from typing import Any

from midair.devices.arrays.autd3_address import autd3_place
from midair.devices.arrays.immediate import ImmediateArray
from midair.devices.arrays.silencer import SilencerChoice, named_silencer
from midair.devices.arrays.streaming import BankedArray
from midair.errors import MissingExtraError
from midair.model import RATE, Placement


def autd3_array(
    where: str = "auto", placement: Placement | None = None, *, silencer: SilencerChoice = "auto"
) -> BankedArray:
    """An array of units with firmware series 0.12, over Ethernet; UnknownDeviceError if an address is invalid.

    Parameters
    ----------
    where : str
        A network interface, ``auto`` to search all of them, ``emulator`` for the SDK's emulator over loopback, the
        address of a running one, such as ``[::1]:50000``, or one of the manufacturer's programs on this computer:
        ``simulator`` or ``simulator:PORT``, ``server`` or ``server:PORT``.
    placement : Placement, optional
        Default: two by two units.
    silencer : {"auto", "off", "quarter", "half", "default"}
        As in `choose_silencer`.
    """
    place = autd3_place(where)
    return BankedArray(
        lambda placement: _module("autd3_udp", "autd3").Autd3Udp(placement, place),
        placement or Placement.grid(),
        name=place.device,
        silencer=silencer,
        simulated=place.simulated,
        exclusive=place.exclusive,
    )


def autd3_immediate(
    where: str = "auto",
    placement: Placement | None = None,
    *,
    silencer: SilencerChoice = "off",
    rate: float = RATE,
    hold: float = 0.006,
    failsafe: float = 0.05,
) -> ImmediateArray:
    """Units as in `autd3_array`, for frames that are computed during playback; InputError if the silencer is unknown.

    Parameters
    ----------
    where, placement
        As in `autd3_array`; not a server, whose own heartbeat would keep the units on.
    silencer : {"off", "quarter", "half", "default"}
        As in `choose_silencer`; not "auto", which depends on a drive.
    rate : float
        Frames per second, in Hz.
    hold : float
        Maximum time by which a frame is sent ahead of its instant, in s.
    failsafe : float
        Time without a frame after which the units go silent, in s.
    """
    place = autd3_place(where)
    return ImmediateArray(
        lambda placement: _module("autd3_single_frames", "autd3").Autd3Immediate(placement, place, failsafe=failsafe),
        placement or Placement.grid(),
        name=place.device,
        silencer=named_silencer(silencer, rate),
        hold=hold,
        simulated=place.simulated,
        exclusive=place.exclusive,
    )


def pyautd3_array(link: str, placement: Placement | None = None, *, silencer: SilencerChoice = "auto") -> BankedArray:
    """An array of units with older firmware, over EtherCAT.

    Parameters
    ----------
    link : str
        ``ethercrab`` to search, ``ethercrab:INTERFACE``, ``twincat``, ``remote:ADDRESS:PORT``, or ``audit`` and ``nop``
        without hardware. Version 38 of the SDK, for Python 3.12 and later, has no ethercrab.
    placement, silencer
        As in `autd3_array`.
    """
    return BankedArray(
        lambda placement: _module("pyautd3_banks", "pyautd3").PyAutd3Banks(placement, link),
        placement or Placement.grid(),
        name=f"pyautd3:{link}",
        silencer=silencer,
        simulated=link in ("audit", "nop"),
        exclusive=None if link in ("audit", "nop") else f"pyautd3:{link}",
    )


def _module(driver: str, extra: str) -> Any:
    try:
        return importlib.import_module(f"midair.devices.arrays.{driver}")
    except ModuleNotFoundError as wrong:
        raise MissingExtraError(
            f'{extra}: expected the package {wrong.name}, it is not installed; pip install "midair[{extra}]"'
        ) from wrong
