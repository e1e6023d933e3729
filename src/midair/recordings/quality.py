"""Unusable channels (constant, clipped, rectified, only noise), and the part of a recording that is not reproduced."""

import numpy as np
from numpy.typing import NDArray

from midair.dsp import Band, welch
from midair.model import Calibration, Recording, Setting


def dead_channels(recording: Recording) -> NDArray[np.bool_]:
    """True for channels that never change, shape (row, column)."""
    return recording.samples.min(axis=0) == recording.samples.max(axis=0)


def clipped_channels(recording: Recording) -> NDArray[np.integer]:
    """Numbers of the channels that reach their maximum or minimum repeatedly."""
    return np.flatnonzero(_flat_tops(recording.samples.reshape(recording.frames, -1)))


def at_limit(samples: NDArray[np.float64], full_scale: float) -> NDArray[np.bool_]:
    """True for samples at the limit of their converter, same shape; all checks for clipping use this rule.

    `full_scale` is the limit on either side, in the unit of the samples.
    """
    # The largest code of a converter is one step below its limit; 1e-4 is more than a step of 14 bits.
    return np.abs(samples) >= full_scale * (1 - 1e-4)


def suspicious(recording: Recording) -> tuple[str, ...]:
    """One sentence for each kind of suspicious channel: constant, white noise only, clipped, outliers, or rectified.

    Constant or noisy cells of a simulated field, or of a footprint, are counted as untouched.

    White noise: a channel more than ten times quieter than the median channel whose von Neumann ratio (mean square of
    successive differences over variance) is within four standard errors of 2 (J. von Neumann, Ann. Math. Stat. 12,
    1941: variance 4 (n - 2) / (n^2 - 1)).

    Clipped: the maximum or minimum is not 0, occurs in at least five places and at least 20 times, and more than four
    times as often as values within half a percent of the range below it (at most 2.4 times as many for a sine). A
    channel with less than 100 levels, such as a tone whose period fits the rate, must also stay at the limit for three
    frames in a row, because a tone repeats its maximum at most once, and must not stay elsewhere; and its levels must
    not be equidistant, as those of a coarse converter are.

    Outliers: at most three values are more than a thousand times as far from the median as all others.

    Rectified, such as the magnitude of an acceleration or a force: no number is below zero, and the values lie mostly
    in the lower part of their range.
    """
    samples = recording.samples.reshape(recording.frames, -1)
    dead, life = dead_channels(recording).ravel() & (recording.frames > 1), recording.provenance
    # Silent cells of a synthetic field are not broken but untouched, and its pressure may be positive.
    synthetic = life.simulated or any(step.stage == "footprint" for step in life.steps)
    report: list[str] = []
    if dead.any() and not synthetic:
        values = ", ".join(f"{i} ({samples[0, i]:g} {recording.unit})" for i in np.flatnonzero(dead))
        report.append(f"Channels that never change: {values}; they are dead, saturated or not touched.")
    if recording.frames >= 100 and not dead.all():
        # Scaled, because squares of very large or small numbers overflow or underflow.
        scaled = samples / 2.0 ** min(int(np.frexp(np.abs(samples).max())[1]), 1023)
        spread = scaled.std(axis=0)
        floor = ~dead & (spread < 0.1 * np.median(spread[~dead])) & _is_white(scaled, spread)
        if synthetic:
            dead |= floor
        elif names := ", ".join(map(str, np.flatnonzero(floor))):
            report.append(f"Channels that hold only white noise, more than ten times below the others: {names}.")
    if synthetic and dead.any():
        report.append(f"{dead.sum()} of {dead.size} cells are untouched.")
    if names := ", ".join(map(str, clipped_channels(recording))):
        report.append(f"Channels that reach their maximum or minimum repeatedly, clipped: {names}.")
    if outliers := _outliers(samples, recording.unit):
        report.append(
            f"Outliers, more than a thousand times as far from the median as the other values: channel"
            f" {', '.join(outliers)}; check them, since a wrong bit or a lost cable looks the same."
        )
    if recording.frames >= 100 and not synthetic and _is_rectified(samples):
        report.append(
            "No number is below zero: if this is a magnitude (of an acceleration, of a force), its vibration is "
            "rectified and appears at other frequencies than the original; use one axis instead."
        )
    return tuple(report)


def _outliers(samples: NDArray[np.float64], unit: str) -> list[str]:
    """Channels with outliers, each with the value that is farthest from the median, and its frame."""
    if len(samples) < 20:
        return []
    found: list[str] = []
    for channel, wave in enumerate(samples.T):
        away = np.abs(wave - np.median(wave))
        far = away.max()
        high = away > far / 1000
        if high.sum() <= 3 and away[~high].max(initial=0) > 0:
            place = int(away.argmax())
            found.append(f"{channel} ({wave[place]:.4g} {unit} in frame {place})")
    return found


def _is_rectified(samples: NDArray[np.float64]) -> bool:
    """True if no channel is ever below zero, and the mean of most is in the lower two fifths of their range."""
    least, greatest, mean = samples.min(axis=0), samples.max(axis=0), samples.mean(axis=0)
    lively = least < greatest
    low = mean - least < (greatest - mean) / 1.5
    return bool(lively.any() and (least >= 0).all() and low[lively].mean() > 0.5)


def _flat_tops(samples: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True for channels that clip, shape (channel,), for samples (frame, channel)."""
    least, greatest = samples.min(axis=0), samples.max(axis=0)
    clipped = np.zeros(len(least), bool)
    for channel, wave in enumerate(samples.T):
        span, change = greatest[channel] - least[channel], np.abs(np.diff(wave))
        step = change[change > 0].min(initial=np.inf)
        held, above = np.zeros(2, bool), False
        for side, depth in enumerate((greatest[channel] - wave, wave - least[channel])):
            top = depth == 0
            near = ((depth > 0) & (depth <= max(0.005 * span, 1.01 * step))).sum()
            visits = top[0] + (top[1:] & ~top[:-1]).sum()
            held[side] = top.sum() >= 20 and visits >= 5 and (greatest, least)[side][channel] != 0
            above |= held[side] and top.sum() > 4 * near and span >= 100 * step
        if held.any():
            # The levels of a computed tone repeat only to rounding.
            x = np.rint((wave - least[channel]) / span * 1e9)
            levels = np.unique(x)
            clipped[channel] = _flat_few(x, levels, held) if len(levels) < 100 else above
    return clipped


def _flat_few(x: NDArray[np.float64], levels: NDArray[np.float64], sides: NDArray[np.bool_]) -> bool:
    """True if a channel of few levels repeats values only at its limits (`sides`), and not on a regular grid."""
    if len(levels) < 3:
        return False
    ends = (sides[0] & (x[1:] == levels[-1])) | (sides[1] & (x[1:] == levels[0]))
    still = x[1:] == x[:-1]
    heights = np.diff(levels)
    multiples = heights / heights.min()
    coarse = np.abs(multiples - np.rint(multiples)).max() < 0.02
    # A tone that is not clipped has its maximum at most twice in a row.
    came = (~still & ends).sum()
    return bool(not coarse and (still & ends).sum() > 1.5 * came and (still & ~ends).sum() <= 0.1 * came)


def _is_white(samples: NDArray[np.float64], spread: NDArray[np.float64]) -> NDArray[np.bool_]:
    n = len(samples)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.square(np.diff(samples, axis=0)).mean(axis=0) / np.square(spread)
    return np.abs(ratio - 2) < 4 * np.sqrt(4 * (n - 2) / (n**2 - 1))


LEAST = 0.1
"""Smallest share of the power that is reported."""


def unreproduced(
    recording: Recording, calibration: Calibration | None, band: Band, frames: slice = slice(None)
) -> dict[str, Setting]:
    """Share of the power of pressure in some frames, and rms of the strongest cell in Pa, for each part left out.

    Parts are frequencies below the band with the mean, those above it, and dead cells, whose power is taken to be that
    of their neighbours; `text` describes those above `LEAST`, and what would reproduce them. Frequencies that the
    calibration does not hold, or at which the sensor has less than a tenth of its response in the band, are left out.
    """
    samples = recording.samples[frames]
    frequency, density = welch(samples, recording.rate, resolution=1.0)
    density, mean = (each.reshape(-1, recording.sensor.count) for each in (density, samples.mean(axis=0)))
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
        "below": f"the slow press below {band[0]:g} Hz, {{}} of the power; keep it: --circle 3mm",
        "above": f"all above {band[1]:g} Hz, {{}} of the power; keep it: a wider --band",
        "dead": f"cells {cells} recorded nothing, about {{}} of the power by their neighbours; repair the sensor",
    }
    told: dict[str, Setting] = {"dead_cells": cells}
    lines: list[str] = []
    for name, part in parts.items():
        share, pressure = float(part.sum() / whole) if whole > 0 else 0.0, float(np.sqrt(part.sum(axis=0).max()))
        told |= {f"{name}_share": share, f"{name}_pa": pressure}
        if share > LEAST:
            lines.append(advice[name].format(f"{100 * share:.0f} %"))
    return told | {"text": "; ".join(lines)}
