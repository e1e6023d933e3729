"""An array's calibration on the command line: taken for what is solved, and told in words."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.files import load_array_calibration
from midair.model import ArrayCalibration, PressureFrames, TransducerArray
from midair.settings import Settings


def as_measured(
    path: Path | None, array: TransducerArray, settings: Settings, pressure: PressureFrames
) -> tuple[TransducerArray, Settings, PressureFrames]:
    """Array, settings and pressure for an array that was measured, if a file says so; as they are if not.

    Raises
    ------
    MismatchError
        If it is another array's.
    """
    if path is None:
        return array, settings, pressure
    known = load_array_calibration(path)
    told = {"file": path.name, "id": known.identifier, "date": known.date}
    life = pressure.provenance.then("array calibration", told, simulated=known.provenance.simulated)
    return known.applied(array), settings.measured(known), replace(pressure, provenance=life)


def array_rows(known: ArrayCalibration) -> list[tuple[str, str]]:
    """What was measured of an array, with expanded uncertainties (k = 2)."""
    alive = ~known.dead

    def of(values: np.ndarray, errors: np.ndarray, unit: str, digits: int) -> str:
        some = values[alive]
        sure = 2 * float(np.median(errors[alive]))
        return f"{some.mean():.{digits}f} {unit}, each ± {some.std():.2g}, known to {sure:.2g} {unit} (k = 2)"

    quality = known.quality_uncertainty * known.quality
    dead = np.flatnonzero(known.dead)
    named = ", ".join(str(number) for number in dead[:20]) + (" and more" if len(dead) > 20 else "")
    return [
        ("array", f"{known.array.name}, {known.array.count} transducers"),
        ("dead", f"{len(dead)}: {named}" if len(dead) else "none"),
        ("strength", of(known.strength, known.strength_uncertainty, "of the model's", 3)),
        ("level of all", f"known to {200 * known.level_uncertainty:.2g} % (k = 2)"),
        ("phase", of(known.phase, known.phase_uncertainty, "rad", 3)),
        ("resonance", of(known.resonance, known.resonance_uncertainty, "Hz", 0)),
        ("quality factor", of(known.quality, quality, "", 1)),
        ("calibration id", f"{known.identifier}, {known.date or 'no date'}"),
    ]
