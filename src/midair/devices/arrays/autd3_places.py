"""Where units of firmware series 0.12 are found, as typed: an interface, an address, a program of the makers."""

import ipaddress
import re
import socket
from dataclasses import dataclass
from typing import Literal

from midair.errors import UnknownDeviceError

SIMULATOR_PORT, SERVER_PORT = 44336, 44338
"""Where the makers' simulator and server listen if nothing else is said (`autd3._autd3`, version 0.12.0)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Autd3Place:
    """Where to look for units.

    Attributes
    ----------
    kind : {"auto", "interface", "address", "emulator", "simulator", "server"}
        Any network interface; one of them; an address with a port; an emulator that is started for this; the makers'
        simulator of sound fields; the makers' server, which holds the units for several programs.
    name : str
        Of an interface; or an address as ``[fe80::1%3]:44336``, its zone a number.
    port : int
        On this computer, of a simulator or a server.
    """

    kind: Literal["auto", "interface", "address", "emulator", "simulator", "server"]
    name: str = ""
    port: int = 0

    @property
    def simulated(self) -> bool:
        """Whether nothing real is there, as far as the name tells: the units themselves say it once they are open."""
        if self.kind == "address":
            return _address(self.name)[0].is_loopback
        return self.kind in ("emulator", "simulator")

    @property
    def device(self) -> str:
        """The name of a device there, as on the command line."""
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
        """What only one program may hold at a time; None for an emulator of its own, which everybody gets who asks."""
        if self.kind == "emulator":
            return None
        # An emulator that runs elsewhere is nobody's units.
        return f"emulator:{self.name}" if self.kind == "address" and self.simulated else self.device


def autd3_place(where: str) -> Autd3Place:
    """What a place means.

    Parameters
    ----------
    where : str
        ``auto``, ``emulator``, ``simulator`` or ``simulator:PORT``, ``server`` or ``server:PORT``, an address such as
        ``[::1]:50000``, or the name of a network interface.

    Raises
    ------
    UnknownDeviceError
        If an address or a port is none, or a server is on another computer.
    """
    kind, colon, rest = where.partition(":")
    if where in ("auto", "emulator"):
        return Autd3Place(kind="auto" if where == "auto" else "emulator")
    if kind == "simulator":
        return Autd3Place(kind="simulator", port=_port(where, rest, SIMULATOR_PORT, colon))
    if kind == "server":
        host, _, port = rest.rpartition(":")
        if host not in ("", "localhost", "[::1]"):
            raise UnknownDeviceError(
                f"autd3-server: expected PORT, the SDK reaches a server on this computer only, got {rest!r}; bring it "
                f"here with ssh -L [::1]:{SERVER_PORT}:[::1]:{SERVER_PORT} HOST"
            )
        return Autd3Place(kind="server", port=_port(where, port, SERVER_PORT, colon))
    if where.startswith("["):
        address, port = _address(where)
        return Autd3Place(kind="address", name=f"[{_numbered(where, address)}]:{port}")
    return Autd3Place(kind="interface", name=where)


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
    """An address whose zone is a number, as the SDK wants it; people know the interface's name."""
    zone = address.scope_id
    if zone is None or zone.isdecimal():
        return str(address)
    try:
        return str(address).replace(f"%{zone}", f"%{socket.if_nametoindex(zone)}")
    except OSError:
        names = ", ".join(name for _, name in socket.if_nameindex())
        raise UnknownDeviceError(f"autd3:{where}: expected one of the interfaces {names}, got {zone!r}") from None
