"""Calibrations that are stated, not measured: --sensitivity, --peak, --reference."""

import re
from dataclasses import replace
from pathlib import Path as File

import numpy as np

from midair.calibration import MicrophoneScale, scale_of_drop, scale_of_tone
from midair.cli.import_options import FileOptions, import_recording
from midair.cli.quantities import parse_quantity
from midair.errors import InputError, MismatchError
from midair.model import Calibration, Provenance, Recording
from midair.streaming import medians, moments


def calibration_from_options(recording: Recording, sensitivity: str | None, peak: float | None) -> Calibration | None:
    """Calibration of a stated sensitivity or peak (Pa); None if neither is given."""
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
    """Value of an option in `unit`; InputError if it is no such quantity."""
    try:
        return parse_quantity(text, unit)
    except ValueError as wrong:
        raise InputError(f"{option}: {wrong}") from None


def scale_by(reference: File, options: FileOptions, tone: str, drop: str | None) -> MicrophoneScale:
    """Scale of a file from a known signal, recorded with the same microphone at the same gain.

    `tone` is its level such as 94dB; `drop` is instead a falling weight as mass, height and diameter, such as
    2g:50mm:10mm.
    """
    taken = import_recording(
        reference, replace(options, scale=1.0, unit=None, footprint=None, resample=None, layout=None)
    )
    recording = taken.recording
    if recording.sensor.count != 1:
        raise InputError(f"{reference}: expected one channel, got {recording.sensor.count}; choose with --channels 0")
    samples = recording.samples.ravel()
    if drop is None:
        level = re.fullmatch(r"([\d.]+)\s*dB", tone)
        if level is None:
            raise InputError(f"--tone: expected a level re 20 µPa such as 94dB, got {tone!r}")
        return scale_of_tone(samples, recording.rate, level=float(level[1]))
    parts = drop.split(":")
    try:
        mass, height, diameter = (
            parse_quantity(part, unit) for part, unit in zip(parts, ("kg", "m", "m"), strict=True)
        )
    except ValueError as wrong:
        raise InputError(f"--drop: expected MASS:HEIGHT:DIAMETER such as 2g:50mm:10mm, got {drop!r}") from wrong
    return scale_of_drop(samples, recording.rate, mass=mass, height=height, diameter=diameter)
