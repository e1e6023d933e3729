"""Measure a sensor's calibration from recordings of a known pressure, with an uncertainty for every number."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.frequency_response import (
    BandSums,
    FrequencyResponse,
    band_sums,
    bend_uncertainty,
    channel_delay,
    check_resolution,
    clock_drift,
    distinct,
    fit_levels,
    predicted_share,
    quiet_density,
    same_levels,
    solve_sums,
    upper_half,
    white_level,
    widened,
)
from midair.calibration.measure.referenced_take import ReferencedTake, check_alike, source_of, spelled
from midair.errors import BandError, InputError, MismatchError
from midair.model import Calibration, Crosstalk, Linearity, Measurement, Provenance, Recording, Setting
from midair.progress import report_progress
from midair.recordings import clipped_channels, dead_channels


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureSettings:
    """Settings for the fit of the frequency response."""

    resolution: float = 1.0
    """Spacing of the bins in Hz."""
    width: float | None = None
    """Width in Hz of the band around a bin in which the response is a polynomial; twice the resolution if None."""
    coherence: float = 0.9
    """Lowest coherence of a valid bin, 0 to 1; every live channel must reach it."""
    order: int = 2
    """Order of the polynomials, see `midair.calibration.measure.frequency_response`."""


def crosstalk_of(
    fits: Sequence[FrequencyResponse], counts: NDArray[np.bool_], *, repeat: Array | float = 0.0
) -> Crosstalk:
    """Compute the crosstalk matrix from the responses of all channels to a pressure on each cell alone.

    C_ik = H_ik / H_ii, with H_ik the response of channel i to a pressure on cell k. The spread in the gel does not
    depend on frequency, so C is the mean of the real part over the bins, weighted by 1 / u^2. If the ratio varies over
    the band more than the noise explains, the uncertainty is increased accordingly (Birge's ratio). The error of the
    reference cancels. `fits` has one response per cell, in the order of the channels, and `repeat` is the relative
    standard uncertainty of each channel's own response from the scatter between takes, because H_ik and H_ii come from
    different takes. A dead channel has no crosstalk.
    """
    response: Complex = np.array([fit.response[counts] for fit in fits])
    spread = np.array([np.abs(fit.response[counts]) * _finite(fit.uncertainty[counts]) for fit in fits])
    cells = np.arange(len(fits))
    own, own_spread = response[cells, :, cells].T, spread[cells, :, cells].T
    heard = np.abs(own) > 0
    size = np.where(heard, np.abs(own), 1)
    ratio = np.real(np.where(heard, response / np.where(heard, own, 1), 0))
    error = np.sqrt((spread / size) ** 2 + (ratio * own_spread / size) ** 2)
    weight = 1 / np.maximum(error, 1e-12) ** 2
    total = weight.sum(axis=1)
    mean = (weight * ratio).sum(axis=1) / total
    chi = (weight * (ratio - mean[:, None]) ** 2).sum(axis=1) / max(len(own) - 1, 1)
    seated = np.broadcast_to(repeat, len(fits))
    uncertainty = np.hypot(np.sqrt(np.maximum(chi, 1) / total), np.abs(mean) * np.hypot(seated[:, None], seated))
    alive = np.asarray(heard.all(axis=0))
    matrix = np.where(alive & alive[:, None], mean, 0).T
    np.fill_diagonal(matrix, 1)
    uncertainty = np.where(alive & alive[:, None], uncertainty, 0).T
    np.fill_diagonal(uncertainty, 0)
    return Crosstalk(matrix=matrix, uncertainty=uncertainty)


def _finite(values: Array) -> Array:
    # An uncertainty is infinite where a response is 0, and their product would be NaN.
    return np.where(np.isfinite(values), values, 1e6)


def repeatability(
    parts: Sequence[BandSums], whole: FrequencyResponse, counts: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Relative standard uncertainty of magnitude, and of phase in rad, from the scatter of takes, shape (channel,).

    Takes differ because the sensor is placed anew and the gel warms up. The variance tau^2 between takes is estimated
    by the method of moments: sum_r w_r (H_r / H - mean)^2 has the expectation (R - 1) + tau^2 (sum w - sum w^2 / sum
    w), with w_r = 1 / u_r^2 (DerSimonian and Laird, Controlled Clinical Trials 7, 1986), pooled over the bands, because
    mostly the gain varies. The common response weights take r by its share p_r of the input's power, so its variance is
    tau^2 sum p_r^2, widened by Student's t for R - 1. The result is 0 for a single take, whose repeatability is
    unknown.
    """
    pressed = np.array([part.points > 0 for part in parts])
    if len(parts) < 2 or not (pressed.sum(axis=0) > 1).any():
        return np.zeros(pressed.shape[1]), np.zeros(pressed.shape[1])
    fits = [solve_sums([part]) for part in parts]
    reference = np.where(whole.response[counts] != 0, whole.response[counts], 1)
    apart = np.array([fit.response[counts] for fit in fits]) / reference - 1
    own = np.array([fit.uncertainty[counts] for fit in fits])
    weight = np.where(pressed[:, None] & np.isfinite(own) & (own > 0), 1 / np.maximum(own, 1e-12) ** 2, 0)
    energy = np.array([part.gram[counts, :, 0, 0].real for part in parts])
    share = energy / np.maximum(energy.sum(axis=0), 1e-300)
    kept = (share**2).sum(axis=0).mean(axis=0)
    number = pressed.sum(axis=0)
    both = [_between(values, weight, number) for values in (apart.real, apart.imag)]
    magnitude, phase = (widened(np.sqrt(tau * kept), np.maximum(number - 1, 1)) for tau in both)
    return magnitude, phase


def _between(values: Array, weight: Array, number: NDArray[np.int64]) -> Array:
    """tau^2 of each channel, from values and weights of shape (take, band, channel)."""
    whole = np.maximum(weight.sum(axis=0), 1e-300)
    mean = (weight * values).sum(axis=0) / whole
    scatter = (weight * (values - mean) ** 2).sum(axis=0)
    free = whole - (weight**2).sum(axis=0) / whole
    return np.maximum((scatter - (number - 1)).sum(axis=0), 0) / np.maximum(free.sum(axis=0), 1e-300)


def measure_calibration(
    takes: Sequence[ReferencedTake],
    *,
    quiet: Recording | None = None,
    settings: MeasureSettings | None = None,
    date: str = "",
    version: int = 1,
) -> Calibration:
    """Measure a calibration from recordings against a reference, with an uncertainty for every number.

    The response of a channel is fitted to all takes that press on it, weighted by their power. Its uncertainty
    combines, as in the GUM, the noise (Bendat and Piersol), the variation between takes beyond the noise, and the
    uncertainty of the reference.

    The takes are noise or sweeps that fill the band; a sweep begins and ends in silence. Either all press on all cells
    at once, or one or more press on each cell alone, which also gives the crosstalk (takes on all cells are then used
    for linearity only). Five different levels give the linearity. `quiet` is a recording without any pressure, for the
    noise; without it, the noise is the residual of the fit. `date` and `version` are as in `Calibration`. Raises
    MismatchError if the takes are not of one sensor, or only some cells were pressed alone; InputError if one is
    clipped; BandError if the takes are too short, or fewer than two bins are valid.
    """
    check_alike(takes)
    _check_unclipped(takes)
    settings, first = settings or MeasureSettings(), takes[0].recording
    if quiet is not None and source_of(quiet) != source_of(first):
        raise MismatchError(f"quiet recording: expected sensor {spelled(first)}, got {spelled(quiet)}")
    step, width = check_resolution(settings.resolution, settings.width)
    parts = [
        band_sums(
            take.reference.pressure[:, None],
            take.recording.samples.reshape(take.recording.frames, -1),
            take.recording.rate,
            resolution=step,
            width=width,
            order=settings.order,
        )
        for take in report_progress(takes, len(takes))
    ]
    alone = _pressed_alone(takes)
    # Takes on all cells contain crosstalk, so they are left out if there are takes on single cells.
    used = [(part, take) for part, take in zip(parts, takes, strict=True) if not alone or take.cell is not None]
    own = [part.only(take.presses()) for part, take in used]
    drift, late = _drift([take for _, take in used])
    fit, shape = solve_sums(own), first.sensor.shape
    alive = np.any([~dead_channels(take.recording).ravel() & take.presses() for take in takes], axis=0)
    counts = _valid_bins(fit, alive, settings)
    linearity, bend = _linearity(parts, takes, fit, counts, alone=alone)
    seated, turned = repeatability(own, fit, counts)
    # For several references, use the largest uncertainty.
    certain = max(take.reference.uncertainty for take in takes)
    # Each averaged complex number has two degrees of freedom. A dead channel is fully uncertain.
    random = widened(np.where(alive, fit.uncertainty[counts], 1.0), 2 * fit.averages)
    magnitude = np.sqrt(random**2 + seated**2 + bend**2 + certain**2)
    frequency, response = fit.frequency[counts], np.where(alive, fit.response[counts], 0)
    phase = np.sqrt(random**2 + turned**2 + (2 * np.pi * frequency[:, None] * late) ** 2)
    delay, delay_error = np.zeros(len(alive)), np.zeros(len(alive))
    if len(frequency) >= 3:
        upper = upper_half(frequency)
        delay, delay_error = channel_delay(frequency[upper], response[upper], random[upper])
    power, averages = fit.noise[counts], float(fit.averages.mean())
    if quiet is not None:
        bins, silent, averages = quiet_density(quiet, resolution=step, width=width)
        power = np.stack([np.interp(frequency, bins, one) for one in silent.T], axis=1)
    noise, noise_error = white_level(power, averages, width / step)
    reference = ", ".join(dict.fromkeys(take.reference.name for take in takes))
    method = (
        f"{len(takes)} takes on {'each cell alone' if alone else 'all cells at once'}, "
        f"{len(distinct(np.array([take.level for take in takes])))} levels, {'a' if quiet else 'no'} quiet recording"
    )
    if np.sum([part.points > 0 for part in own], axis=0).min() < 2:
        method += "; one take on a cell, so that repeatability is not known"
    if late:
        clocks = f"are {1e6 * drift:.2g} ppm apart" if drift else "may differ, which no sweep shows"
        method += f"; the clocks of sensor and reference {clocks}, so that phases are uncertain"
    simulated = first.provenance.simulated or any(take.reference.simulated for take in takes)
    history = Provenance(source=f"measured against {reference}", simulated=simulated, notes=first.provenance.notes)
    details: dict[str, Setting] = {
        "resolution_hz": step,
        "width_hz": width,
        "coherence": settings.coherence,
        "order": settings.order,
        "takes": tuple(take.recording.provenance.source for take in takes),
        "levels_pa": tuple(round(take.level, 6) for take in takes),
        "reference_uncertainty": certain,
        "quiet": "none" if quiet is None else quiet.provenance.source,
    }
    each = {
        "coherence": np.where(alive, fit.coherence[counts], 0),
        "magnitude_uncertainty": np.where(alive, magnitude, 1),
        "phase_uncertainty": np.where(alive, np.minimum(phase, np.pi), np.pi),
        "noise_density": np.sqrt(power),
        "noise_uncertainty": noise_error,
        "delay": delay,
        "delay_uncertainty": np.where(alive, np.hypot(delay_error, late), 0),
    }
    return Calibration(
        sensor=first.sensor,
        frequency=frequency,
        response=response.reshape(-1, *shape),
        noise=noise.reshape(shape),
        unit=first.unit,
        date=date,
        version=version,
        provenance=history.then("measure calibration", details),
        measurement=Measurement(
            **{name: values.reshape(*values.shape[:-1], *shape) for name, values in each.items()},
            reference_uncertainty=certain,
            reference=reference,
            method=method,
            takes=len(takes),
        ),
        crosstalk=_crosstalk(parts, takes, counts, seated) if alone else None,
        linearity=linearity,
    )


def _valid_bins(fit: FrequencyResponse, alive: NDArray[np.bool_], settings: MeasureSettings) -> NDArray[np.bool_]:
    """Bins in which every live channel is coherent, widely excited, and uncertain by less than half."""
    sure = (fit.coherence >= settings.coherence) & (fit.uncertainty < 0.5)
    # With fewer excited frequencies than terms, the fit would always be perfect.
    sure &= fit.excited > settings.order + 2
    counts = np.asarray(np.all(sure[:, alive], axis=1), np.bool_)
    if not alive.any() or counts.sum() < 2:
        raise BandError(
            f"response: expected two bins or more with a coherence of {settings.coherence:g} on every live channel, "
            f"got {counts.sum() if alive.any() else 0}; press harder, longer, or with a wider band"
        )
    return counts


def _crosstalk(
    parts: Sequence[BandSums], takes: Sequence[ReferencedTake], counts: NDArray[np.bool_], repeat: Array
) -> Crosstalk:
    on_cells: dict[int, list[BandSums]] = {}
    for part, take in zip(parts, takes, strict=True):
        if take.cell is not None:
            on_cells.setdefault(take.cell, []).append(part)
    return crosstalk_of([solve_sums(on_cells[cell]) for cell in sorted(on_cells)], counts, repeat=repeat)


def _linearity(
    parts: Sequence[BandSums],
    takes: Sequence[ReferencedTake],
    fit: FrequencyResponse,
    counts: NDArray[np.bool_],
    *,
    alone: bool,
) -> tuple[Linearity | None, Array]:
    """Linearity if there are five levels, and its contribution to the uncertainty, shape (channel,)."""
    levels, sensor = np.array([take.level for take in takes]), takes[0].recording.sensor
    chosen = same_levels(levels, [take.cell for take in takes], sensor.count)
    if chosen is None:
        return None, np.zeros(sensor.count)
    shares = [predicted_share(part, fit, counts) for part in parts]
    share, error = (np.array([one[n] for one in shares])[chosen, np.arange(sensor.count)] for n in (0, 1))
    pressure, shape = levels[chosen], (len(chosen), *sensor.shape)
    if alone:
        # Takes on all cells contain crosstalk, so the share is normalised to 1 at the level of the single takes.
        usual = np.median([take.level for take in takes if take.cell is not None])
        there = share[np.abs(np.log(pressure / usual)).argmin(axis=0), np.arange(sensor.count)]
        share, error = share / there, error / there
    line = fit_levels(*(values.reshape(shape) for values in (pressure, share * pressure, error * pressure)))
    return line, bend_uncertainty(share, error)


UNKNOWN = 50e-6
"""Relative difference of two clocks that a take does not show: usual quartz crystals are within 50 ppm."""


def _drift(takes: Sequence[ReferencedTake]) -> tuple[float, float]:
    """Largest drift between the clocks of sensor and reference, and the delay that it adds to half of its take, in s.

    Both are 0 if no drift is above four times its standard error, and for one clock.
    """
    found = [(0.0, 0.0)]
    for take in (each for each in takes if each.reference.own_clock):
        flat = take.recording.samples.reshape(take.recording.frames, -1)
        drift, error = clock_drift(take.reference.pressure, flat[:, take.presses()], take.recording.rate)
        if not np.isfinite(error):
            found.append((0.0, UNKNOWN * take.recording.duration / 2))
        elif abs(drift) > 4 * error:
            found.append((abs(drift), abs(drift) * take.recording.duration / 2))
    return max(found, key=lambda one: one[1])


def _check_unclipped(takes: Sequence[ReferencedTake]) -> None:
    """Raise InputError with the numbers of the takes that are clipped; the clipped part is unknown."""
    if found := [str(number) for number, take in enumerate(takes, 1) if clipped_channels(take.recording).size]:
        raise InputError(
            f"takes: expected none that is clipped, which lowers the response, got take {', '.join(found)}; press "
            "less hard there, or leave it out"
        )


def _pressed_alone(takes: Sequence[ReferencedTake]) -> bool:
    """True if each cell was pressed alone; raise a MismatchError if only some cells were."""
    pressed = {take.cell for take in takes if take.cell is not None}
    missing = [cell for cell in range(takes[0].recording.sensor.count) if cell not in pressed]
    if pressed and missing:
        raise MismatchError(
            f"takes: expected a take on every single cell, or on none, got no take on cells "
            f"{', '.join(map(str, missing))}; record the missing takes, or remove the takes on single cells"
        )
    return bool(pressed)
