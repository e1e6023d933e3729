"""What commands say of a recording, and of the calibration that it has."""

import numpy as np

from midair.cli.terminal.quantities import spell
from midair.model import Calibration, Recording
from midair.recordings import dead_channels


def recording_rows(recording: Recording) -> list[tuple[str, str]]:
    """What a recording holds, as names and values."""
    rows, columns = recording.sensor.shape
    dead = np.flatnonzero(dead_channels(recording))
    return [
        ("frames", f"{recording.frames} at {recording.rate:.6g} Hz, {recording.duration:.3f} s"),
        ("sensor", f"{recording.sensor.name}, {rows} x {columns}, pitch {spell(recording.sensor.pitch, 'm')}"),
        ("unit", recording.unit),
        ("range", f"{recording.samples.min():.4g} to {recording.samples.max():.4g} {recording.unit}"),
        ("dead channels", ", ".join(str(channel) for channel in dead) or "none"),
    ]


def recording_figures(recording: Recording) -> dict[str, object]:
    """What a recording holds, for a program: numbers in units that their names carry."""
    rows, columns = recording.sensor.shape
    return {
        "frames": recording.frames,
        "rate_hz": recording.rate,
        "duration_s": recording.duration,
        "sensor": {
            "name": recording.sensor.name,
            "rows": rows,
            "columns": columns,
            "pitch_m": recording.sensor.pitch,
        },
        "unit": recording.unit,
        "range": [float(recording.samples.min()), float(recording.samples.max())],
        "dead_channels": np.flatnonzero(dead_channels(recording)).tolist(),
    }


def calibration_figures(calibration: Calibration | None) -> dict[str, object] | None:
    """Which calibration a recording has, for a program; None where it has none."""
    if calibration is None:
        return None
    return {
        "source": calibration.provenance.source,
        "id": calibration.identifier,
        "version": calibration.version,
        "date": calibration.date or None,
    }


def calibrated_by(calibration: Calibration | None) -> str:
    """Where a calibration comes from, or what to do without one."""
    if calibration is None:
        return "none; state one with midair calibrate --sensitivity or --peak"
    return " ".join(part for part in (calibration.provenance.source, calibration.date) if part)
