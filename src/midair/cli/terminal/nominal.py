"""A calibration that somebody states instead of measuring one: --sensitivity and --peak."""

from dataclasses import replace

import numpy as np

from midair.cli.terminal.quantities import parse_quantity
from midair.errors import InputError, MismatchError
from midair.medians import medians
from midair.model import Calibration, Provenance, Recording
from midair.reel import moments


def nominal_calibration(recording: Recording, sensitivity: str | None, peak: float | None) -> Calibration | None:
    """The calibration that a stated sensitivity or peak (in Pa) means, if one was stated.

    Raises
    ------
    MismatchError
        If both were.
    InputError
        If the sensitivity is no such quantity, or the peak or the recording makes no sense.
    """
    if sensitivity is not None and peak is not None:
        raise MismatchError("expected --sensitivity or --peak, got both; state one")
    if sensitivity is not None:
        value = stated_sensitivity(sensitivity, f"{recording.unit}/Pa", "--sensitivity")
        return Calibration.flat(recording.sensor, sensitivity=value, unit=recording.unit)
    if peak is None:
        return None
    rest, found = medians(recording.samples), moments(recording.samples)
    change = np.maximum(found.greatest - rest, rest - found.least).max()
    if change == 0 or peak <= 0:
        raise InputError(
            f"--peak: expected a pressure above 0 and a recording that changes, got {peak:g} Pa, {change:g}"
        )
    flat = Calibration.flat(recording.sensor, sensitivity=float(change / peak), unit=recording.unit)
    stated = f"stated: the largest change of any channel, {change:.4g} {recording.unit}, is {peak:g} Pa"
    return replace(flat, provenance=Provenance(source=stated))


def stated_sensitivity(text: str, unit: str, option: str) -> float:
    """The number of `unit` that an option states.

    Raises
    ------
    InputError
        If it is no quantity of that kind.
    """
    try:
        return parse_quantity(text, unit)
    except ValueError as wrong:
        raise InputError(f"{option}: {wrong}") from None
