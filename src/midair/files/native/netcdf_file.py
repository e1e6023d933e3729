"""NetCDF-4 by the CF conventions: midair's HDF5 file with the attributes that NetCDF programs expect."""

from pathlib import Path

from midair.files.file_format import Format, FormatLoss
from midair.files.native.calibration_file import write_calibration
from midair.files.native.hdf5 import fixed_text, new_file, write_group
from midair.files.native.recording_file import read_recording, recording_values
from midair.files.native.schema import NETCDF
from midair.model import Calibration, Recording
from midair.version import __version__

CONVENTIONS = "CF-1.11"


def write_netcdf(recording: Recording, path: Path, calibration: Calibration | None) -> tuple[FormatLoss, ...]:
    """Write a recording atomically and without loss; the calibration is a group."""
    life = recording.provenance
    attributes: dict[str, str] = {
        "Conventions": CONVENTIONS,
        "title": f"Recording of {recording.sensor.name}",
        "source": life.source + (" (SIMULATED)" if life.simulated else ""),
        "history": "; ".join(step.stage for step in life.steps) or "recorded",
        "comment": f"Written by midair {__version__}; its provenance is JSON in the attribute provenance.",
    }
    with new_file(path, room=recording.samples.nbytes) as file:
        write_group(file, "recording", recording_values(recording))
        if calibration is not None:
            write_calibration(file.create_group("calibration"), calibration)
        for entry in NETCDF:
            file.attrs[entry.name] = fixed_text(attributes[entry.name])
    return ()


NETCDF4 = Format(name="NetCDF of midair", read=read_recording, write=write_netcdf)
