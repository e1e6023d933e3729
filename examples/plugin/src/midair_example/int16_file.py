"""Raw files .int16: int16 counts of 16 channels, frame after frame, little-endian. The rate must be stated."""

from pathlib import Path

import numpy as np

from midair.errors import BrokenFileError, RateError
from midair.files import Format, FormatLoss, ImportOptions, OpenedTake, atomic_file
from midair.model import Calibration, Recording

CHANNELS = 16


def read_int16(path: Path, options: ImportOptions) -> OpenedTake:
    """Read a file; the rate comes from the user."""
    if options.rate is None:
        raise RateError(f"{path}: expected a frame rate, since the file has none; state it, such as 1 kHz")
    counts = np.fromfile(path, "<i2")
    if len(counts) % CHANNELS:
        raise BrokenFileError(f"{path}: expected whole frames of {CHANNELS} channels, got {len(counts)} numbers")
    samples = counts.reshape(-1, 4, 4).astype(np.float64)
    return OpenedTake(recording=Recording(samples=samples, rate=options.rate, unit="count"))


def write_int16(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write rounded counts, and report the information that the file cannot hold."""
    with atomic_file(path) as partial:
        np.asarray(recording.samples).round().astype("<i2").tofile(partial)
    lost = [FormatLoss(what="rate", text="The rate was left out; state it when the file is read.")]
    if calibration is not None:
        lost.append(FormatLoss(what="calibration", text="The calibration was left out."))
    return tuple(lost)


INT16 = Format(name="raw int16", read=read_int16, write=write_int16, memory=4)
