"""Rows and JSON values that describe a take."""

from midair.cli.quantities import format_quantity
from midair.cli.stage_options import recorded_strokes, stroke_rows
from midair.devices import SensorDevice
from midair.files import open_take
from midair.model import Provenance
from midair.rig import Take, take_problems


def take_rows(take: Take, device: SensorDevice) -> list[tuple[str, str]]:
    """A take as rows, with its problems."""
    rows, columns = device.grid.shape
    return [
        ("recording", str(take.path)),
        ("frames", f"{take.frames} at {device.rate:.6g} Hz, {take.frames / device.rate:.3f} s"),
        ("sensor", f"{device.grid.name}, {rows} x {columns}, pitch {format_quantity(device.grid.pitch, 'm')}"),
        ("range", f"{take.lowest:.4g} to {take.highest:.4g} {device.unit}"),
        *(
            []
            if take.path is None
            else stroke_rows(open_take(take.path, streamed=True).recording.provenance, device.rate)
        ),
        *take_problems(take, device.rate),
    ]


def take_values(take: Take, device: SensorDevice) -> dict[str, object]:
    """A take as JSON values."""
    levels = take.levels
    return {
        "recording": str(take.path),
        "frames": take.frames,
        "rate_hz": device.rate,
        "lost_frames": take.lost,
        "end": take.end,
        "range": [take.lowest, take.highest],
        "clipped_channels": levels.clipped.nonzero()[0].tolist(),
        "dead_channels": levels.dead.nonzero()[0].tolist(),
        "stuck_channels": levels.stuck.nonzero()[0].tolist(),
        "rate_ppm": None if take.rate is None else take.rate.ppm,
        "clock_ppm": None if take.clock is None else take.clock.ppm,
        **({"strokes": strokes} if (strokes := recorded_strokes(_provenance(take), device.rate)) else {}),
    }


def _provenance(take: Take) -> Provenance:
    """Provenance with the events of the recording, from the file."""
    return Provenance() if take.path is None else open_take(take.path, streamed=True).recording.provenance
