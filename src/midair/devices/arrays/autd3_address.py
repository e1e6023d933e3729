"""Addresses of units with firmware series 0.12: an interface, an address, or a program of the manufacturer."""

import ipaddress
import re
import socket
from dataclasses import dataclass
from typing import Literal

from midair.errors import UnknownDeviceError

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
