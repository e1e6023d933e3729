"""Check the settings of this computer that devices need: IPv6, firewall, network card, priority, groups, disk.

The checks need no special rights and change nothing. Tests replace the root folder of the files that they read.
"""

import array
import os
import shutil
import socket
import struct
import sys
from collections.abc import Callable
from pathlib import Path

from midair.devices import state_folder
from midair.rig.doctor.check import Check, missing, ok

PORT = 44336
"""UDP port from which AUTD3 units of series 0.12 answer (the makers' page on networks)."""
ROOM = 2e9
"""Free bytes on a disk below which a warning is given: 16 channels at 48 kHz in float64 fill 6 MB a second."""

Moderation = Callable[[str], int | None]
"""From a network card's name to its interrupt delay in µs; None if unknown."""


def machine_findings(root: Path = Path("/"), *, moderation: Moderation | None = None) -> list[Check]:
    """Check the settings of this computer that devices need: files below `root` and interrupt delays of the cards."""
    if sys.platform != "linux":
        return [
            ok(
                "this computer",
                "IPv6, firewall, network card, priority and groups are checked on Linux only",
                f"allow inbound UDP from port {PORT}, and switch off interrupt moderation of the card",
            ),
            _disk_space(Path()),
        ]
    cards = _cards(root)
    return [
        _ipv6(root),
        _firewall(root),
        *(_moderation(card, (moderation or rx_delay)(card)) for card in cards),
        _priority(root),
        _locked_memory(root),
        *(_group(root, name, use) for name, use in (("dialout", "serial sensors"), ("audio", "sound cards"))),
        _disk_space(Path()),
    ]


def rx_delay(card: str) -> int | None:
    """Interrupt delay of a network card in µs (ethtool's rx-usecs); None if the kernel does not report it."""
    if sys.platform != "linux":
        return None
    import fcntl

    # struct ethtool_coalesce of linux/ethtool.h: 23 numbers; the first is the command, the second rx_usecs.
    asked = array.array("I", [0x0000000E, *[0] * 22])
    # struct ifreq: the name, and a pointer to the request; 40 bytes on 64 bits.
    request = struct.pack("16sP16x", card.encode()[:15], asked.buffer_info()[0])
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            fcntl.ioctl(any_socket, 0x8946, request)  # SIOCETHTOOL
    except OSError:
        return None
    return asked[1]


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None


def _cards(root: Path) -> list[str]:
    """Network cards with hardware behind them."""
    folder = root / "sys/class/net"
    try:
        return sorted(each.name for each in folder.iterdir() if (each / "device").exists())
    except OSError:
        return []


def _ipv6(root: Path) -> Check:
    """Check for link-local IPv6 addresses, which AUTD3 units use."""
    subject, found = "IPv6", _text(root / "proc/net/if_inet6")
    if found is None or (_text(root / "proc/sys/net/ipv6/conf/all/disable_ipv6") or "0").strip() == "1":
        advice = "units of series 0.12 need it: sudo sysctl net.ipv6.conf.all.disable_ipv6=0; no ipv6.disable=1 at boot"
        return missing(subject, "off", advice)
    # Columns: address, index, length, scope, flags, name; link-local addresses begin with fe80.
    rows = [line.split() for line in found.splitlines() if line.strip()]
    cards = sorted({row[-1] for row in rows if row[0].startswith("fe80")})
    if not cards:
        advice = "no card has an fe80 address: sudo ip link set eth0 up, or sysctl net.ipv6.conf.eth0.disable_ipv6=0"
        return missing(subject, "on, but no card has an address", advice)
    return ok(subject, f"addresses on {', '.join(cards)}")


def _firewall(root: Path) -> Check:
    """Check which firewalls are active; their rules can be read only by root."""
    rule = f"inbound UDP from port {PORT}"
    running = []
    if "enabled=yes" in (_text(root / "etc/ufw/ufw.conf") or "").lower():
        running.append(("ufw", f"sudo ufw allow proto udp from any port {PORT}"))
    if (root / "run/firewalld").is_dir() or (root / "run/firewalld.pid").exists():
        running.append(("firewalld", f"sudo firewall-cmd --permanent --add-source-port={PORT}/udp, then --reload"))
    modules = {line.split()[0] for line in (_text(root / "proc/modules") or "").splitlines() if line.strip()}
    if not running and modules & {"nf_tables", "ip6table_filter"}:
        allow = f"sudo nft add rule inet filter input udp sport {PORT} accept"
        running.append(("the kernel's filter", f"if sudo nft list ruleset drops input: {allow}"))
    if not running:
        return ok("firewall", "none seen")
    names, advice = ", ".join(name for name, _ in running), "; ".join(how for _, how in running)
    return ok("firewall", f"{names}; {rule} must be allowed", advice)


def _moderation(card: str, delay: int | None) -> Check:
    subject = f"interrupts of {card}"
    if delay is None:
        advice = f"before the first play: sudo ethtool -C {card} rx-usecs 0"
        return ok(subject, "the card does not report its delay", advice)
    if delay > 0:
        advice = f"for units on it: sudo ethtool -C {card} adaptive-rx off rx-usecs 0"
        return ok(subject, f"the card waits {delay} us for more packets", advice)
    return ok(subject, "not delayed")


def _priority(root: Path) -> Check:
    """Check whether this user may use real-time priority."""
    subject, allowed, advice = "real-time priority", _limit(root, "realtime priority"), _RAISE.format("rtprio 20")
    if allowed is None or (allowed == "0" and not _is_root(root)):
        return missing(subject, "not allowed" if allowed else "not reported by the system", advice)
    return ok(subject, "allowed" if allowed == "0" else f"up to {allowed}")


def _locked_memory(root: Path) -> Check:
    """Check whether live touch may lock its memory, about 500 MB."""
    subject, allowed, advice = "locked memory", _limit(root, "locked memory"), _RAISE.format("memlock unlimited")
    if allowed is None:
        return missing(subject, "not reported by the system", advice)
    if allowed == "unlimited" or _is_root(root) or (allowed.isdecimal() and int(allowed) >= 2**30):
        return ok(subject, "allowed")
    found = f"up to {int(allowed) / 1e6:.3g} MB" if allowed.isdecimal() else allowed
    return missing(subject, f"{found}; live touch needs more", advice)


_RAISE = "add '@audio - {}' to /etc/security/limits.d/midair.conf, join that group, log in again"


def _limit(root: Path, name: str) -> str | None:
    """Soft limit of this process, as text; None if the system does not report it."""
    lines = (_text(root / "proc/self/limits") or "").splitlines()
    return next((line.split()[3] for line in lines if line.startswith(f"Max {name}")), None)


def _group(root: Path, name: str, use: str) -> Check:
    """Check whether this process is in a group that may use devices; a new membership counts from the next login."""
    subject, entry = f"group {name}", None
    for line in (_text(root / "etc/group") or "").splitlines():
        fields = line.split(":")
        if len(fields) >= 4 and fields[0] == name:
            entry = fields
    if entry is None:
        return ok(subject, f"no such group here; {use} need none")
    status = _status(root)
    if _is_root(root) or entry[2] in [*status.get("Groups", []), *status.get("Gid", [])]:
        return ok(subject, f"may use {use}")
    user = os.environ.get("USER", "")
    if user and user in entry[3].split(","):
        return missing(subject, "joined, active after the next login", "log out and in again")
    advice = f"for {use}: sudo usermod -aG {name} $USER, then log out and in again"
    return missing(subject, f"not a member, which {use} may need", advice)


def _is_root(root: Path) -> bool:
    return _status(root).get("Uid", ["", ""])[1:2] == ["0"]


def _status(root: Path) -> dict[str, list[str]]:
    """Lines of /proc/self/status by name."""
    lines = (line.partition(":") for line in (_text(root / "proc/self/status") or "").splitlines())
    return {name: rest.split() for name, _, rest in lines}


def _disk_space(folder: Path) -> Check:
    """Check the free disk space for recordings and for the log."""
    said, short = [], False
    for name, place in (("here", folder), ("for the log", state_folder())):
        near = next(each for each in (place.absolute(), *place.absolute().parents) if each.exists())
        free = shutil.disk_usage(near).free
        said.append(f"{free / 1e9:.1f} GB {name}")
        short = short or free < ROOM
    advice = "free disk space: 16 channels at 48 kHz fill 6 MB a second, at 1 kHz .13 MB" if short else ""
    return Check(subject="room", state="missing" if short else "ok", found=", ".join(said), advice=advice)
