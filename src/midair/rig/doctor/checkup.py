"""Check the installation: Python, libraries, folder, field model, solver, sensors, and the settings of the computer.

The checks of the computer need no special rights and change nothing. Tests replace the root folder of the files that
they read.
"""

import array
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import socket
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from midair.blas import VARIABLE, WIDE, misses_wide_kernel
from midair.devices import state_folder
from midair.errors import DeviceError, MidairError, MissingExtraError
from midair.files import open_take, save
from midair.model import (
    HEIGHT,
    RATE,
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Medium,
    Recording,
    SensorWiring,
    TransducerArray,
)
from midair.physics import focus_phase, quantise_phase, transfer_matrix
from midair.progress import report_progress
from midair.recordings import at_limit
from midair.rig.doctor.array_checkup import Check, array_findings, broken, missing, ok
from midair.rig.names import SENSORS, source_sensor
from midair.solvers import solve

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
    lines = (line.partition(":") for line in (_text(root / "proc/self/status") or "").splitlines())
    return {name: rest.split() for name, _, rest in lines}


def _disk_space(folder: Path) -> Check:
    said, short = [], False
    for name, place in (("here", folder), ("for the log", state_folder())):
        near = next(each for each in (place.absolute(), *place.absolute().parents) if each.exists())
        free = shutil.disk_usage(near).free
        said.append(f"{free / 1e9:.1f} GB {name}")
        short = short or free < ROOM
    advice = "free disk space: 16 channels at 48 kHz fill 6 MB a second, at 1 kHz .13 MB" if short else ""
    return Check(subject="room", state="missing" if short else "ok", found=", ".join(said), advice=advice)


def run_checks(device: str | None = None) -> list[Check]:
    """Run all checks that need no hardware, and those of an array or a live sensor if one is named.

    An array (`array_named`) is opened, queried and closed, and stays silent; a live sensor (`sensor_named`) is read for
    half a second.
    """
    live = device is not None and device.partition(":")[0] in SENSORS
    looks: list[Callable[[], Sequence[Check]]] = [
        lambda: [ok("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}")],
        lambda: [_library(name) for name in ("numpy", "scipy", "h5py", "soundfile", "matplotlib")],
        lambda: [_extra("xarray", "analysis", "opens recordings for analysis")],
        *((lambda look=look: [look()]) for look in (_folder, _field, _solver, _threads, _kernel)),
        machine_findings,
        sensor_findings,
        lambda: live_sensor_findings(device) if device is not None and live else [],
        lambda: array_findings(None if live else device),
    ]
    return [found for look in report_progress(looks, len(looks)) for found in look()]


def _library(name: str) -> Check:
    try:
        return ok(name, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return broken(name, "not installed", f"pip install {name}")


def _extra(name: str, extra: str, use: str) -> Check:
    if importlib.util.find_spec(name) is None:
        return missing(name, f"not installed; {use}", f'pip install "midair[{extra}]"')
    return ok(name, f"{importlib.metadata.version(name)}; {use}")


def _folder() -> Check:
    """Check that a recording can be written to the current folder and read back."""
    recording = Recording(samples=np.arange(32.0).reshape(2, 4, 4), rate=RATE)
    try:
        with tempfile.TemporaryDirectory(dir=".") as folder:
            save(recording, Path(folder) / "check.h5")
            same = np.array_equal(open_take(Path(folder) / "check.h5").recording.samples, recording.samples)
    except OSError as wrong:
        reason = wrong.strerror or str(wrong)
        return broken("this folder", reason, "change to a folder you can write to")
    if not same:
        return broken("this folder", "a recording differed after reading it back", "check the disk")
    return ok("this folder", "a recording was written and read back")


def _field() -> Check:
    """Compare the focus of four units with the value of AUTD3's own emulator."""
    array, point = TransducerArray.autd3(), np.array([[0, 0, HEIGHT]])
    # The emulator computes point sources without loss.
    acoustics = Acoustics(medium=Medium(attenuation=0), directivity="point")
    matrix = transfer_matrix(point, array, acoustics=acoustics)
    q = np.exp(1j * quantise_phase(focus_phase(array, point[0], acoustics=acoustics)))
    rms = float(np.abs(matrix @ q)[0] / np.sqrt(2))
    found = f"{rms:.2f} Pa rms at the focus; AUTD3's emulator gives 12875.04"
    if abs(rms - 12875.038) > 0.1:
        return broken("field model", found, "reinstall NumPy")
    return ok("field model", found)


def _solver() -> Check:
    """Time of one iteration, on the paper's array and control points."""
    grid, array = ControlGrid(), TransducerArray.autd3()
    amplitude = np.zeros((1, grid.count))
    amplitude[0, grid.count // 2 + grid.columns // 2] = 1000.0
    target = AmplitudeFrames(amplitude=amplitude, rate=RATE, grid=grid)
    # A first run, so that loading SciPy is not timed.
    solve(target, array, iterations=1)
    begin = time.perf_counter()
    solution = solve(target, array, iterations=20)
    took = (time.perf_counter() - begin) / max(1, int(solution.iterations[0]))
    return ok("solver", f"{1e3 * took:.1f} ms per iteration of 996 x 256")


def _threads() -> Check:
    from threadpoolctl import threadpool_info

    pools = ", ".join(f"{pool['internal_api']} {pool['num_threads']}" for pool in threadpool_info()) or "none loaded"
    return ok("threads", f"{os.cpu_count()} cores; {pools}; solvers use one BLAS thread")


def _kernel() -> Check:
    """Check the kernel of the matrix products, which take most of the solvers' time."""
    from threadpoolctl import threadpool_info

    # SciPy may load a second BLAS; the solvers use NumPy's.
    kernels = {pool.get("architecture", "unknown") for pool in threadpool_info() if "numpy" in pool["filepath"]}
    found = ", ".join(sorted(kernels)) or "a BLAS other than OpenBLAS"
    cpuinfo = Path("/proc/cpuinfo")
    missed = cpuinfo.is_file() and misses_wide_kernel(cpuinfo.read_text(encoding="utf-8")) and WIDE not in kernels
    return Check(
        subject="matrix kernel",
        state="missing" if missed else "ok",
        found=f"{found}, 256 bits on a processor that has 512" if missed else found,
        advice=f"set {VARIABLE}={WIDE} before Python starts: complex products take half the time" if missed else "",
    )


def sensor_findings() -> list[Check]:
    """Check the virtual sensor, and the package, library and connected devices of each kind of live sensor."""
    return [ok("virtual sensor", "always available, as is replay:FILE"), *(_kind(kind) for kind in SENSORS)]


def live_sensor_findings(name: str, wiring: SensorWiring | None = None) -> list[Check]:
    """Open a live sensor, read it for half a second, and check the samples."""
    plain = name.partition("?")[0]
    try:
        with source_sensor(name, wiring=wiring) as sensor:
            sensor.start()
            block = sensor.read(max(2, round(0.5 * sensor.rate)))
            said = sensor.describe()
            unit, full_scale = sensor.unit, sensor.full_scale
    except MidairError as wrong:
        # A message of midair has advice after its semicolon.
        found, _, advice = str(wrong).partition("; ")
        return [broken(plain, found, advice or "see docs, build a sensor")]
    low, high = block.samples.min(axis=0), block.samples.max(axis=0)
    largest = np.maximum(np.abs(low), np.abs(high)).ravel()
    clipping = [] if full_scale is None else [str(each) for each in np.flatnonzero(at_limit(largest, full_scale))]
    still = [str(channel) for channel in np.flatnonzero(low.ravel() == high.ravel())]
    return [
        *(ok(f"{plain}: {subject}", found) for subject, found in said.items()),
        _channel_check(plain, "cells that never change", still, "check their wires and their supply"),
        _channel_check(plain, "cells that clip", clipping, "lower the gain"),
        ok(f"{plain}: samples", f"{low.min():.4g} to {high.max():.4g} {unit}"),
    ]


def _channel_check(name: str, subject: str, cells: list[str], advice: str) -> Check:
    if not cells:
        return ok(f"{name}: {subject}", "none")
    return broken(f"{name}: {subject}", ", ".join(cells), advice)


def _kind(kind: str) -> Check:
    try:
        driver = SENSORS[kind]
        found = driver.available()
    except MissingExtraError as wrong:
        found, _, advice = str(wrong).partition("; ")
        return missing(f"{kind}: sensors", found, f"{advice} if you have such a sensor")
    except DeviceError as wrong:
        return missing(f"{kind}: sensors", str(wrong), "only needed if you have such a sensor")
    version = f"{driver.package} {importlib.metadata.version(driver.package)}; " if driver.package else ""
    return ok(f"{kind}: sensors", version + found)
