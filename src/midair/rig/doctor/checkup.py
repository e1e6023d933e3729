"""Check the installation: Python, libraries, folder, field model, solver, sensors, and parts of the other checks."""

import importlib.metadata
import importlib.util
import os
import platform
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from midair.blas import VARIABLE, WIDE, misses_wide_kernel
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
from midair.rig.doctor.array_checkup import array_findings
from midair.rig.doctor.check import Check, broken, missing, ok
from midair.rig.doctor.machine_checkup import machine_findings
from midair.rig.names import SENSORS, source_sensor
from midair.solvers import solve


def run_checks(device: str | None = None) -> list[Check]:
    """Run all checks that need no hardware, and those of an array or a live sensor if one is named.

    An array (`array_named`) is opened, queried and closed, and stays silent; a live sensor (`sensor_named`) is read for
    half a second.
    """
    live = device is not None and is_live_sensor(device)
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


def is_live_sensor(name: str) -> bool:
    """Whether a name is that of a live sensor rather than of an array."""
    return name.partition(":")[0] in SENSORS


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
