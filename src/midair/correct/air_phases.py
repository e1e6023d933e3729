"""Correct the phases of a drive for another speed of sound than it was solved for."""

from dataclasses import replace

import numpy as np

from midair.array_types import Array
from midair.model import Drive, Medium
from midair.physics import wavenumber
from midair.streaming import LazyFrames


def correct_air(drive: Drive, room: Medium, centre: Array) -> Drive:
    """Change the phases of a drive so that its waves arrive at one point as they do in the air it was solved for.

    ``phase_i - (k_room - k_solved) d_i``, with d_i the distance of transducer i from the point `centre` (m), such as
    the centre of the control points, and k = 2 pi f / c. The correction is exact at the point and approximate around
    it; levels do not change. The result is a drive for the air of the room.
    """
    change = wavenumber(drive.array, room) - wavenumber(drive.array, drive.acoustics.medium)
    shift = change * np.linalg.norm(drive.array.position - centre, axis=1)
    phase = drive.phase
    lazy = isinstance(phase, LazyFrames)
    return replace(
        drive,
        phase=phase.mapped(lambda block: block - shift) if lazy else phase - shift,
        acoustics=replace(drive.acoustics, medium=room),
        provenance=drive.provenance.then(
            "correct_air", {"from_m_s": drive.acoustics.medium.speed, "to_m_s": room.speed}
        ),
    )
