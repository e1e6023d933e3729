"""A sensor's calibration from what it said while a known pressure acted on it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.evidence import Evidence, MeasureSettings, sums_of
from midair.calibration.measure.linearity import distinct
from midair.calibration.measure.referenced_take import ReferencedTake, check_alike
from midair.errors import MismatchError
from midair.model import Calibration, PressureFrames, Provenance, Recording, Setting
from midair.progress import passing

Array = NDArray[np.float64]


def measure_response(
    recording: Recording,
    pressure: PressureFrames,
    *,
    resolution: float = 1.0,
    coherence: float = 0.9,
    date: str = "",
) -> Calibration:
    """Calibration from one recording of a known pressure that differs from cell to cell.

    Parameters
    ----------
    recording : Recording
        What the sensor said.
    pressure : PressureFrames
        What acted on its cells at the same time and rate: noise or a sweep that fills the band, for 12 / resolution
        seconds or more.
    resolution, coherence
        See `MeasureSettings`.
    date : str
        When it was measured, ISO 8601.

    Returns
    -------
    Calibration
        At the bins that count; a dead channel has response 0.

    Raises
    ------
    MismatchError
        If the two do not have the same cells, rate and number of frames.
    BandError
        If fewer than two bins count.
    """
    _check_pair(recording, pressure)
    settings = MeasureSettings(resolution=resolution, coherence=coherence)
    x, y = (values.reshape(len(values), -1) for values in (pressure.pressure, recording.samples))
    part = sums_of(x, y, recording.rate, settings)
    simulated = pressure.provenance.simulated
    found = Evidence(recording=recording, parts=(part,), own=(part,), settings=settings, reference="known pressure")
    life = recording.provenance.then("measure response", settings.as_settings(), simulated=simulated)
    return found.calibration(date=date, version=1, provenance=life, method="one recording of a known pressure")


def measure_calibration(
    takes: Sequence[ReferencedTake],
    *,
    quiet: Recording | None = None,
    settings: MeasureSettings | None = None,
    date: str = "",
    version: int = 1,
) -> Calibration:
    """Calibration of a sensor from recordings against a reference, with an uncertainty on every number.

    The response of a channel rests on all takes that press on it, weighted by their power. Its uncertainty combines, as
    in the GUM, the noise (Bendat and Piersol), what the takes differ by beyond it, and the reference's own.

    Parameters
    ----------
    takes : sequence of Take
        Noise or sweeps that fill the band; a sweep begins and ends in silence. On all cells at once, or one take or
        more on each cell alone, which also gives the crosstalk (takes on all cells then count for linearity only).
        Five different levels give the linearity.
    quiet : Recording, optional
        A recording in which nothing presses, for the noise; without it that is what the reference does not explain.
    settings : MeasureSettings, optional
        The defaults if None.
    date : str
        When it was measured, ISO 8601.
    version : int
        Version of this sensor's calibration.

    Returns
    -------
    Calibration
        At the bins that count.

    Raises
    ------
    MismatchError
        If the takes are not of one sensor, or some cells but not all were pressed on alone.
    BandError
        If the takes are too short, or fewer than two bins count.
    """
    check_alike(takes)
    settings = settings or MeasureSettings()
    first = takes[0].recording
    _check_quiet(quiet, first)
    parts = tuple(
        sums_of(take.reference.pressure[:, None], _flat(take.recording), first.rate, settings)
        for take in passing(takes, len(takes))
    )
    alone = _pressed_alone(takes)
    own = tuple(
        # With single presses at hand, those on all cells are left out: there the neighbours are felt, too.
        part.only(take.presses())
        for part, take in zip(parts, takes, strict=True)
        if not alone or take.cell is not None
    )
    found = Evidence(
        recording=first,
        parts=parts,
        own=own,
        settings=settings,
        takes=tuple(takes),
        alone=alone,
        quiet=quiet,
        reference=", ".join(dict.fromkeys(take.reference.name for take in takes)),
        # Of several references the least sure one counts.
        reference_uncertainty=max(take.reference.uncertainty for take in takes),
    )
    where = "each cell alone" if alone else "all cells at once"
    levels = len(distinct(np.array([take.level for take in takes])))
    method = f"{len(takes)} takes on {where}, {levels} levels, {'a' if quiet else 'no'} quiet recording"
    if np.sum([part.points > 0 for part in own], axis=0).min() < 2:
        method += "; one take on a cell, so that repeatability is not known"
    simulated = first.provenance.simulated or any(take.reference.simulated for take in takes)
    life = Provenance(source=f"measured against {found.reference}", simulated=simulated, notes=first.provenance.notes)
    told: dict[str, Setting] = {
        **settings.as_settings(),
        "takes": tuple(take.recording.provenance.source for take in takes),
        "levels_pa": tuple(round(take.level, 6) for take in takes),
        "reference_uncertainty": found.reference_uncertainty,
        "quiet": "none" if quiet is None else quiet.provenance.source,
    }
    life = life.then("measure calibration", told)
    return found.calibration(date=date, version=version, provenance=life, method=method)


def _flat(recording: Recording) -> Array:
    return recording.samples.reshape(recording.frames, -1)


def _pressed_alone(takes: Sequence[ReferencedTake]) -> bool:
    """Whether each cell was pressed on alone.

    Raises
    ------
    MismatchError
        If some were and others not.
    """
    pressed = {take.cell for take in takes if take.cell is not None}
    missing = [cell for cell in range(takes[0].recording.sensor.count) if cell not in pressed]
    if pressed and missing:
        raise MismatchError(
            f"takes: expected every cell pressed on alone, or none, got no take on cells "
            f"{', '.join(map(str, missing))}; record the missing ones, or leave the single ones out"
        )
    return bool(pressed)


def _check_quiet(quiet: Recording | None, first: Recording) -> None:
    if quiet is None:
        return
    have, want = (quiet.sensor, quiet.unit, quiet.rate), (first.sensor, first.unit, first.rate)
    if have != want:
        raise MismatchError(
            f"quiet recording: expected sensor {want[0].name!r} {want[0].shape} in {want[1]} at {want[2]:g} Hz, got "
            f"{have[0].name!r} {have[0].shape} in {have[1]} at {have[2]:g} Hz"
        )


def _check_pair(recording: Recording, pressure: PressureFrames) -> None:
    have = (pressure.sensor.shape, pressure.rate, pressure.frames)
    want = (recording.sensor.shape, recording.rate, recording.frames)
    if have != want:
        raise MismatchError(
            f"pressure: expected {want[2]} frames at {want[1]:g} Hz on {want[0]} cells like the recording's, got "
            f"{have[2]} at {have[1]:g} Hz on {have[0]}; align and resample it first"
        )
