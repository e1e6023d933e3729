"""AUTD3 arrays for each SDK, and the addresses of their units; an SDK is imported only when a device opens."""

import importlib
import ipaddress
import re
import socket
from dataclasses import dataclass
from typing import Any, Literal

from midair.devices.arrays.immediate import ImmediateArray
from midair.devices.arrays.silencer import SilencerChoice, silencer_named
from midair.devices.arrays.streaming import BankedArray
from midair.errors import MissingExtraError, UnknownDeviceError
from midair.model import RATE, Placement

SIMULATOR_PORT, SERVER_PORT = 44336, 44338
"""Default ports of the manufacturer's simulator and server (`autd3._autd3`, version 0.12.0)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Autd3Address:
    """Address of units."""

    kind: Literal["auto", "interface", "address", "emulator", "simulator", "server"]
    """Any interface; one interface; an address with a port; a new emulator; the manufacturer's simulator of sound
    fields; the manufacturer's server, which shares the units among programs."""
    name: str = ""
    """Name of an interface, or an address such as ``[fe80::1%3]:44336`` with a numeric zone."""
    port: int = 0
    """Port of a simulator or server on this computer."""

    @property
    def simulated(self) -> bool:
        """True if there are no real units, judged by the name; the units themselves report it once they are open."""
        if self.kind == "address":
            return _address(self.name)[0].is_loopback
        return self.kind in ("emulator", "simulator")

    @property
    def device(self) -> str:
        """Name of the device, as on the command line."""
        match self.kind:
            case "auto":
                return "autd3"
            case "simulator" | "server":
                return f"autd3-{self.kind}:{self.port}"
            case "emulator":
                return "autd3:emulator"
            case _:
                return f"autd3:{self.name}"

    @property
    def exclusive(self) -> str | None:
        """Name of the lock, see `device_lock`; None for an emulator that is started for this program."""
        if self.kind == "emulator":
            return None
        # A running emulator does not block real units.
        return f"emulator:{self.name}" if self.kind == "address" and self.simulated else self.device


def autd3_place(where: str) -> Autd3Address:
    """Parse an address, see `autd3_array`; raises UnknownDeviceError if it is invalid or a server is not local."""
    kind, colon, rest = where.partition(":")
    if where in ("auto", "emulator"):
        return Autd3Address(kind="auto" if where == "auto" else "emulator")
    if kind == "simulator":
        return Autd3Address(kind="simulator", port=_port(where, rest, SIMULATOR_PORT, colon))
    if kind == "server":
        host, _, port = rest.rpartition(":")
        if host not in ("", "localhost", "[::1]"):
            raise UnknownDeviceError(
                f"autd3-server: expected PORT, the SDK reaches a server on this computer only, got {rest!r}; forward "
                f"its port with ssh -L [::1]:{SERVER_PORT}:[::1]:{SERVER_PORT} HOST"
            )
        return Autd3Address(kind="server", port=_port(where, port, SERVER_PORT, colon))
    if where.startswith("["):
        address, port = _address(where)
        return Autd3Address(kind="address", name=f"[{_numbered(where, address)}]:{port}")
    return Autd3Address(kind="interface", name=where)


def _port(where: str, text: str, usual: int, colon: str) -> int:
    if not colon:
        return usual
    # The simulator's next port is its control port.
    if not (text.isdecimal() and 1 <= int(text) <= 65534):
        raise UnknownDeviceError(f"autd3-{where}: expected a port from 1 to 65534, got {text!r}")
    return int(text)


def _address(where: str) -> tuple[ipaddress.IPv6Address, int]:
    found = re.fullmatch(r"\[(.+)\]:(\d{1,5})", where)
    try:
        if found and 0 < int(found[2]) < 65536:
            return ipaddress.IPv6Address(found[1]), int(found[2])
    except ipaddress.AddressValueError:
        pass
    raise UnknownDeviceError(f"autd3: expected an IPv6 address with a port, such as [::1]:50000, got {where!r}")


def _numbered(where: str, address: ipaddress.IPv6Address) -> str:
    """An address with a numeric zone, which the SDK requires, instead of the interface's name."""
    zone = address.scope_id
    if zone is None or zone.isdecimal():
        return str(address)
    try:
        return str(address).replace(f"%{zone}", f"%{socket.if_nametoindex(zone)}")
    except OSError:
        names = ", ".join(name for _, name in socket.if_nameindex())
        raise UnknownDeviceError(f"autd3:{where}: expected one of the interfaces {names}, got {zone!r}") from None


def autd3_array(
    where: str = "auto", placement: Placement | None = None, *, silencer: SilencerChoice = "off"
) -> BankedArray:
    """An array of units with firmware series 0.12, over Ethernet; UnknownDeviceError if an address is invalid.

    `where` is a network interface, ``auto`` to search all of them, ``emulator`` for the SDK's emulator over loopback,
    the address of a running one, such as ``[::1]:50000``, or one of the manufacturer's programs on this computer:
    ``simulator`` or ``simulator:PORT``, ``server`` or ``server:PORT``. The default placement is two by two units;
    `silencer` is as in `silencer_named`.
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

    `where` is not a server, whose own heartbeat would keep the units on. `rate` is in frames per second, `hold` the
    maximum time in s by which a frame is sent ahead of its instant, `failsafe` the time in s without a frame after
    which the units go silent.
    """
    place = autd3_place(where)
    return ImmediateArray(
        lambda placement: _module("autd3_single_frames", "autd3").Autd3Immediate(placement, place, failsafe=failsafe),
        placement or Placement.grid(),
        name=place.device,
        silencer=silencer_named(silencer, rate),
        hold=hold,
        simulated=place.simulated,
        exclusive=place.exclusive,
    )


def pyautd3_array(link: str, placement: Placement | None = None, *, silencer: SilencerChoice = "off") -> BankedArray:
    """An array of units with older firmware, over EtherCAT.

    `link` is ``ethercrab`` to search, ``ethercrab:INTERFACE``, ``twincat``, ``remote:ADDRESS:PORT``, or ``audit`` and
    ``nop`` without hardware. Version 38 of the SDK, for Python 3.12 and later, has no ethercrab.
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
