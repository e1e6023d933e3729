"""Part of a recording that a drive does not reproduce: outside the band, and on cells that recorded nothing."""

import numpy as np

from midair.dsp import Band, welch
from midair.model import Calibration, Recording, Setting
from midair.recordings.quality import dead_channels
from midair.streaming import moments

LEAST = 0.05
"""Smallest share of the power that is reported."""


def unreproduced(recording: Recording, calibration: Calibration | None, band: Band) -> dict[str, Setting]:
    """Share of the pressure's power, and rms of the strongest cell in Pa, for each part that is not reproduced.

    Parts are frequencies below the band with the mean, those above it, and dead cells, whose power is taken to be that
    of their neighbours; `text` describes those above `LEAST`, and what would reproduce them. Frequencies that the
    calibration does not hold, or at which the sensor has less than a tenth of its response in the band, are left out.
    """
    frequency, density = welch(recording.samples, recording.rate, resolution=1.0)
    density, mean = (each.reshape(-1, recording.sensor.count) for each in (density, moments(recording.samples).mean))
    size, first = np.ones(density.shape), 0.0
    if calibration is not None:
        first = float(calibration.frequency[0])
        size = np.abs(calibration.response_at(frequency)).reshape(density.shape)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    if len(frequency) < 2 or not inside.any():
        return {"text": ""}
    seen = (size >= 0.1 * np.median(size[inside], axis=0)) & (frequency >= first)[:, None]
    power = np.divide(density, size**2, out=np.zeros_like(density), where=seen) * (frequency[1] - frequency[0])
    power[0] = np.divide(mean[0] ** 2, size[0] ** 2, out=np.zeros_like(size[0]), where=seen[0])
    dead = dead_channels(recording)
    # Cells that a footprint does not touch are silent on purpose.
    if any(step.stage == "footprint" for step in recording.provenance.steps):
        dead = np.zeros_like(dead)
    power[:, dead.ravel()] = 0
    parts = {"below": power[frequency < band[0]], "above": power[frequency > band[1]], "dead": np.zeros((1, dead.size))}
    played = power[inside].sum(axis=0).reshape(dead.shape)
    for row, column in np.argwhere(dead):
        near = np.hypot(*np.subtract(np.indices(dead.shape), [[[row]], [[column]]])) <= 1
        alive = played[near & ~dead]
        parts["dead"][0, row * dead.shape[1] + column] = alive.mean() if len(alive) else 0.0
    whole = played.sum() + sum(float(part.sum()) for part in parts.values())
    cells = tuple(int(cell) for cell in np.flatnonzero(dead))
    advice = {
        "below": f"below {band[0]:g} Hz: a wider --band keeps what changes, --circle 3mm makes steady pressure felt",
        "above": f"above {band[1]:g} Hz: a wider --band keeps it",
        "dead": f"on cells {cells} that recorded nothing, as much as on their neighbours: repair the sensor",
    }
    told: dict[str, Setting] = {"dead_cells": cells}
    lines: list[str] = []
    for name, part in parts.items():
        share, pressure = float(part.sum() / whole) if whole > 0 else 0.0, float(np.sqrt(part.sum(axis=0).max()))
        told |= {f"{name}_share": share, f"{name}_pa": pressure}
        if share > LEAST:
            lines.append(f"{100 * share:.0f} % of the power ({pressure:.2g} Pa rms) {advice[name]}")
    return told | {"text": "; ".join(lines)}
