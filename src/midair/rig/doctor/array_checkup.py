"""Check the software, rights and network that arrays need, and the state of a named array."""

import importlib.metadata
import os
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from midair.devices import close_orders, playing_now, state_folder
from midair.errors import FileError, MidairError
from midair.rig.names import array_named


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Result of one check."""

    subject: str
    state: Literal["ok", "missing", "broken"]
    """"missing" stands for something optional."""
    found: str
    advice: str = ""
    """One line of advice; empty if there is nothing to do."""


def ok(subject: str, found: str, advice: str = "") -> Check:
    """Return a result without problem."""
    return Check(subject=subject, state="ok", found=found, advice=advice)


def missing(subject: str, found: str, advice: str = "") -> Check:
    """Return the lack of something optional."""
    return Check(subject=subject, state="missing", found=found, advice=advice)


def broken(subject: str, found: str, advice: str = "") -> Check:
    """Return a problem."""
    return Check(subject=subject, state="broken", found=found, advice=advice)


_ADVICE = {
    "firmware": "update the units to series 0.12 by the makers' console; firmware v10 to v12.1 plays with pyautd3",
    "link": "use a separate wired interface, no switch with energy saving; the usual cause is a weak power supply",
    "failsafe": "it acted because the computer stopped sending: check for sleep mode or overload",
    "temperature": "let the units cool, and lower the level",
}
"""Advice where a unit's own report shows a problem."""


def array_findings(device: str | None = None) -> list[Check]:
    """Check software, rights and network, and the state of a device if one is named."""
    return [
        ok("virtual array", "AUTD3 2 x 2; always available"),
        _sdk("autd3", ("0.12",), "firmware series 0.12, over Ethernet; and its emulator"),
        _sdk("pyautd3", ("36", "38"), "older firmware, over EtherCAT"),
        _interfaces(),
        *([_raw_sockets()] if _installed("pyautd3") else []),
        _log(),
        _playing(),
        *([] if device is None else device_findings(device)),
    ]


def device_findings(name: str) -> list[Check]:
    """Open a device, read its description, and close it; it stays silent."""
    try:
        with array_named(name) as array:
            said = array.describe()
    except MidairError as wrong:
        # A message of midair has advice after its semicolon.
        found, _, advice = str(wrong).partition("; ")
        return [broken(name, found, advice or "midair play --help lists the arrays")]
    return report_findings(name, said)


def report_findings(name: str, said: Mapping[str, str]) -> list[Check]:
    """Check the description of an open array."""
    return [
        broken(f"{name}: {subject}", found, _ADVICE[subject])
        if {
            "firmware": "but the SDK supports" in found,
            "link": "heartbeats missed" in found and " 0 heartbeats missed" not in found,
            "failsafe": "it acted" in found and "it acted 0 times" not in found,
            "temperature": found == "too hot",
        }.get(subject, False)
        else ok(f"{name}: {subject}", found)
        for subject, found in said.items()
    ]


def _installed(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _sdk(package: str, series: tuple[str, ...], use: str) -> Check:
    version = _installed(package)
    if version is None:
        advice = f'pip install "midair[{package}]" if you have such units'
        return missing(package, f"not installed; {use}", advice)
    if not any(version.startswith(one + ".") for one in series):
        advice, expected = f'pip install "midair[{package}]"', " or ".join(f"{one}.*" for one in series)
        return broken(package, f"{version}, expected {expected}; {use}", advice)
    return ok(package, f"{version}; {use}")


def _interfaces() -> Check:
    names = [name for _, name in socket.if_nameindex() if not name.startswith("lo")]
    if not names:
        return missing("network", "no interface but loopback", "connect a network card for the units")
    return ok(
        "network",
        ", ".join(names),
        f"if the first opening takes long or fails, name the interface: --device autd3:{names[0]}",
    )


def _raw_sockets() -> Check:
    """Check the right to open raw sockets, which EtherCAT needs on Linux."""
    subject, family = "EtherCAT rights", getattr(socket, "AF_PACKET", None)
    if sys.platform != "linux" or family is None:
        return ok(subject, "not checked on this system; Windows needs Npcap")
    try:
        # Opening a socket needs the right; nothing is sent.
        socket.socket(family, socket.SOCK_RAW).close()
    except PermissionError:
        advice = "sudo setcap cap_net_raw,cap_sys_nice=ep on the python that .venv/bin/python links to"
        return missing(subject, "may not open raw sockets", advice)
    except OSError as wrong:
        return missing(subject, wrong.strerror or str(wrong), "use a wired network")
    return ok(subject, "may open raw sockets")


def _log() -> Check:
    """Check that the log can be written, and close the orders of programs that died."""
    path = state_folder() / "played.jsonl"
    nearest = next(parent for parent in (path, *path.parents) if parent.exists())
    if path.is_dir() or (nearest != path and not nearest.is_dir()) or not os.access(nearest, os.W_OK):
        advice = "set MIDAIR_STATE to a folder you can write to; nothing plays without a log"
        return broken("log of what played", f"cannot write {path}", advice)
    try:
        close_orders()
    except FileError as wrong:
        return broken("log of what played", str(wrong))
    return ok("log of what played", str(path))


def _playing() -> Check:
    programs = [f"{each.get('device')} (process {each['process']}, {each['command']})" for each in playing_now()]
    if programs:
        return ok("playing now", ", ".join(programs), "midair stop silences")
    return ok("playing now", "nothing")
