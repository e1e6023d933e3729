"""Measure a sensor's calibration from recordings of a known pressure."""

from collections.abc import Sequence

import numpy as np

from midair.calibration.measure.linearity import distinct
from midair.calibration.measure.referenced_take import ReferencedTake, check_alike
from midair.calibration.measure.take_sums import MeasureSettings, TakeSums, sums_of
from midair.errors import MismatchError
from midair.model import Calibration, Provenance, Recording, Setting
from midair.progress import report_progress


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

    Parameters
    ----------
    takes : sequence of ReferencedTake
        Noise or sweeps that fill the band; a sweep begins and ends in silence. Either all takes press on all cells at
        once, or one or more takes press on each cell alone, which also gives the crosstalk (takes on all cells are then
        used for linearity only). Five different levels give the linearity.
    quiet : Recording, optional
        A recording without any pressure, for the noise; without it, the noise is the residual of the fit.
    date, version
        As in `Calibration`.

    Raises
    ------
    MismatchError
        If the takes are not of one sensor, or only some cells were pressed alone.
    BandError
        If the takes are too short, or fewer than two bins are valid.
    """
    check_alike(takes)
    settings = settings or MeasureSettings()
    first = takes[0].recording
    _check_quiet(quiet, first)
    parts = tuple(
        sums_of(take.reference.pressure[:, None], take.recording, settings)
        for take in report_progress(takes, len(takes))
    )
    alone = _pressed_alone(takes)
    own = tuple(
        # Takes on all cells contain crosstalk, so they are left out if there are takes on single cells.
        part.only(take.presses())
        for part, take in zip(parts, takes, strict=True)
        if not alone or take.cell is not None
    )
    found = TakeSums(
        recording=first,
        parts=parts,
        own=own,
        settings=settings,
        takes=tuple(takes),
        alone=alone,
        quiet=quiet,
        reference=", ".join(dict.fromkeys(take.reference.name for take in takes)),
        # For several references, use the largest uncertainty.
        reference_uncertainty=max(take.reference.uncertainty for take in takes),
    )
    where = "each cell alone" if alone else "all cells at once"
    levels = len(distinct(np.array([take.level for take in takes])))
    method = f"{len(takes)} takes on {where}, {levels} levels, {'a' if quiet else 'no'} quiet recording"
    if np.sum([part.points > 0 for part in own], axis=0).min() < 2:
        method += "; one take on a cell, so that repeatability is not known"
    simulated = first.provenance.simulated or any(take.reference.simulated for take in takes)
    history = Provenance(
        source=f"measured against {found.reference}", simulated=simulated, notes=first.provenance.notes
    )
    details: dict[str, Setting] = {
        **settings.as_settings(),
        "takes": tuple(take.recording.provenance.source for take in takes),
        "levels_pa": tuple(round(take.level, 6) for take in takes),
        "reference_uncertainty": found.reference_uncertainty,
        "quiet": "none" if quiet is None else quiet.provenance.source,
    }
    history = history.then("measure calibration", details)
    return found.calibration(date=date, version=version, provenance=history, method=method)


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


def _check_quiet(quiet: Recording | None, first: Recording) -> None:
    if quiet is None:
        return
    have, want = (quiet.sensor, quiet.unit, quiet.rate), (first.sensor, first.unit, first.rate)
    if have != want:
        raise MismatchError(
            f"quiet recording: expected sensor {want[0].name!r} {want[0].shape} in {want[1]} at {want[2]:g} Hz, got "
            f"{have[0].name!r} {have[0].shape} in {have[1]} at {have[2]:g} Hz"
        )
