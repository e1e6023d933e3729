"""Live touch during a recording: a group of its file with the played frames, one for each frame of samples."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.files.native.axes import array_from, array_values, check_time
from midair.files.native.hdf5 import (
    check_kind,
    open_file,
    read_group,
    signature,
    stored_dataset,
    stored_group,
    write_group,
)
from midair.files.native.provenance_json import from_json
from midair.model import PlayedTouch, Provenance, TransducerArray

if TYPE_CHECKING:
    import h5py

PLAYED = ("time", "phase_steps", "intensity", "instant", "state")
"""Datasets that grow with the frames."""


def played_values(array: TransducerArray, rate: float, provenance: Provenance) -> dict[str, Any]:
    """Stored values before the first frame."""
    return {
        **signature("played", provenance),
        "rate_hz": rate,
        "time": np.zeros(0),
        **array_values(array),
        "phase_steps": np.zeros((0, array.count), np.uint8),
        "intensity": np.zeros(0, np.uint8),
        "instant": np.zeros(0, np.int64),
        "state": np.zeros(0, np.int8),
    }


def write_played(group: "h5py.Group", played: PlayedTouch) -> None:
    """Write the whole group into a new file."""
    known = {name: getattr(played, name) for name in PLAYED[1:]}
    values = played_values(played.array, played.rate, played.provenance)
    write_group(group, "played", {**values, "time": np.arange(played.frames) / played.rate, **known})


def load_played(path: str | os.PathLike[str]) -> PlayedTouch | None:
    """Read the live touch that was played during a recording; None if there was none.

    The file may still be open for writing, or its writer may have been killed. Errors are those of `load_solution`.
    """
    with open_file(path) as file:
        check_kind(file, "recording", Path(path))
        if "played" not in file:
            return None
        live = not stored_dataset(file, "finished")[()]
        values = read_group(stored_group(file, "played"), "played", Path(path), live=live)
        if live:
            # After a writer was killed, frames without a time were not written.
            frames = int(np.isfinite(values["time"]).sum())
            values |= {name: values[name][:frames] for name in PLAYED}
        check_time(values, Path(path))
        return PlayedTouch(
            **{name: values[name] for name in PLAYED[1:]},
            rate=values["rate_hz"],
            array=array_from(values),
            provenance=from_json(values["provenance"]),
        )
