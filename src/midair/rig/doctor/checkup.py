"""Check Python, libraries, folders, a solve and a named device, with advice for each problem."""

import importlib.metadata
import os
import platform
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from midair.devices import close_orders, state_folder
from midair.errors import DeviceError, FileError, MidairError, MissingExtraError, UnknownDeviceError
from midair.files import open_take, save
from midair.model import RATE, AmplitudeFrames, ControlGrid, Recording, TransducerArray
from midair.physics import focus_phase, transfer_matrix
from midair.progress import report_progress
from midair.recordings import at_limit
from midair.rig.names.array_names import array_named
from midair.rig.names.sensor_names import SENSORS, source_sensor
from midair.solvers import solve


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check."""

    subject: str
    found: str
    advice: str = ""
    """One line of advice; empty if there is nothing to do."""
    use: str = ""
    """Work that is possible if it is ok, for the last line of the report."""
    state: Literal["ok", "missing", "broken"] = "ok"
    """"missing" stands for something optional."""


ok, missing, broken = Check, partial(Check, state="missing"), partial(Check, state="broken")
"""A result without problem, the lack of something optional, and a problem."""

_ADVICE = {
    "firmware": "update the units to series 0.12 by the makers' console; firmware v10 to v12.1 plays with pyautd3",
    "link": "use a separate wired interface, no switch with energy saving; the usual cause is a weak power supply",
    "failsafe": "it acted because the computer stopped sending: check for sleep mode or overload",
    "temperature": "let the units cool, and lower the level",
}
"""Advice where a unit's own report shows a problem."""

_EXTRAS = {
    "numba": ("live", ("0",), "live touch"),
    "autd3": ("autd3", ("0.12",), "AUTD3 units of firmware series 0.12, and their emulator"),
    "pyautd3": ("pyautd3", ("36", "37", "38"), "AUTD3 units of older firmware"),
    "distributed": ("sweep", ("",), "sweeps"),
    "xarray": ("analysis", ("",), "xarray"),
}
"""Packages: their extra, the beginnings of their versions, and what they are for."""


def run_checks(device: str | None = None) -> list[Check]:
    """Check what needs no hardware, and an array or a live sensor if one is named.

    An array (`array_named`) is opened, queried and closed, and stays silent; a live sensor (`sensor_named`) is read for
    half a second.
    """
    live = device is not None and device.partition(":")[0] in SENSORS
    looks: list[Callable[[], Sequence[Check]]] = [
        lambda: [ok("Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}")],
        lambda: [_libraries()],
        lambda: [_folder(), _log()],
        lambda: [_solver()],
        lambda: [_kind(kind) for kind in SENSORS],
        lambda: [_extra(package) for package in _EXTRAS],
        lambda: [] if device is None else live_sensor_findings(device) if live else device_findings(device),
    ]
    return [found for look in report_progress(looks, len(looks)) for found in look()]


def readiness(checks: Sequence[Check]) -> str:
    """Return what the checks say that this computer is ready for, and what is missing, in one line."""
    uses = {state: [each.use for each in checks if each.use and each.state == state] for state in ("ok", "missing")}
    wrong = [each.subject for each in checks if each.state == "broken"]
    parts = [f"ready for {', '.join(uses['ok']) or 'nothing'}"]
    parts += [f"missing: {', '.join(uses['missing'])}"] if uses["missing"] else []
    return "; ".join([*parts, *([f"broken: {', '.join(wrong)}"] if wrong else [])])


def device_findings(name: str) -> list[Check]:
    """Open an array, read its description, and close it; it stays silent."""
    try:
        with array_named(name) as array:
            said = array.describe()
    except MidairError as wrong:
        return [_refused(name, wrong, "midair play --help lists the arrays")]
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


def live_sensor_findings(name: str) -> list[Check]:
    """Open a live sensor, read it for half a second, and check the samples."""
    plain = name.partition("?")[0]
    try:
        with source_sensor(name) as sensor:
            sensor.start()
            block = sensor.read(max(2, round(0.5 * sensor.rate)))
            said = sensor.describe()
            unit, full_scale = sensor.unit, sensor.full_scale
    except MidairError as wrong:
        return [_refused(plain, wrong, "see docs, build a sensor")]
    low, high = block.samples.min(axis=0), block.samples.max(axis=0)
    largest = np.maximum(np.abs(low), np.abs(high)).ravel()
    clipping = [] if full_scale is None else np.flatnonzero(at_limit(largest, full_scale)).tolist()
    still = np.flatnonzero(low.ravel() == high.ravel()).tolist()
    return [
        *(ok(f"{plain}: {subject}", found) for subject, found in said.items()),
        *(
            broken(f"{plain}: {subject}", ", ".join(map(str, cells)), advice)
            if cells
            else ok(f"{plain}: {subject}", "none")
            for subject, cells, advice in (
                ("cells that never change", still, "check their wires and their supply"),
                ("cells that clip", clipping, "lower the gain"),
            )
        ),
        ok(f"{plain}: samples", f"{low.min():.4g} to {high.max():.4g} {unit}"),
    ]


def _refused(name: str, wrong: MidairError, otherwise: str) -> Check:
    if isinstance(wrong, UnknownDeviceError) and repr(name) in str(wrong):
        raise wrong  # a name that is typed wrong, no fault of a device
    found, _, advice = str(wrong).partition("; ")
    return broken(name, found, advice or otherwise)


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _libraries() -> Check:
    versions = {name: _version(name) for name in ("numpy", "scipy", "h5py", "soundfile", "matplotlib")}
    absent = [name for name, version in versions.items() if version is None]
    if absent:
        return broken("libraries", f"{', '.join(absent)} not installed", f"pip install {' '.join(absent)}")
    return ok("libraries", ", ".join(f"{name} {version}" for name, version in versions.items()))


def _extra(package: str) -> Check:
    extra, series, use = _EXTRAS[package]
    version, advice = _version(package), f'pip install "midair[{extra}]"'
    if version is None:
        return missing(package, "not installed", f"{advice} if you need it", use)
    if not version.startswith(series):
        return broken(package, f"{version}, expected {' or '.join(f'{one}.*' for one in series)}", advice, use)
    return ok(package, version, use=use)


def _folder() -> Check:
    """Check that a recording can be written to the current folder and read back."""
    recording = Recording(samples=np.arange(32.0).reshape(2, 4, 4), rate=RATE)
    try:
        with tempfile.TemporaryDirectory(dir=".") as folder:
            save(recording, Path(folder) / "check.h5")
            same = np.array_equal(open_take(Path(folder) / "check.h5").recording.samples, recording.samples)
    except OSError as wrong:
        return broken("this folder", wrong.strerror or str(wrong), "change to a folder you can write to")
    if not same:
        return broken("this folder", "a recording differed after reading it back", "check the disk")
    return ok("this folder", "a recording was written and read back", use="files")


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


def _solver() -> Check:
    """Solve for the field of a focus, which the array can produce."""
    grid, array = ControlGrid(), TransducerArray.autd3()
    field = transfer_matrix(grid, array) @ np.exp(1j * focus_phase(array, np.array([0, 0, grid.height])))
    target = AmplitudeFrames(amplitude=np.abs(field)[None], rate=RATE, grid=grid)
    error = float(solve(target, array, iterations=20).error[0])
    if not error < 0.1:
        return broken("solve", f"E {100 * error:.1f} % for a focus, expected below 10 %", "reinstall NumPy and SciPy")
    return ok("solve", f"E {100 * error:.1f} % for a focus", use="solving, the virtual sensor and array")


def _kind(kind: str) -> Check:
    subject, use = f"{kind}: sensors", f"{kind} sensors"
    try:
        driver = SENSORS[kind]
        found = driver.available()
    except MissingExtraError as wrong:
        found, _, advice = str(wrong).partition("; ")
        return missing(subject, found, f"{advice} if you have such a sensor", use)
    except DeviceError as wrong:
        return missing(subject, str(wrong), "only needed if you have such a sensor", use)
    version = f"{driver.package} {importlib.metadata.version(driver.package)}; " if driver.package else ""
    return ok(subject, version + found, use=use)
