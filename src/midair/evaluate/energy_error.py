"""How well a target was met, frame by frame and by energy: faint frames, of which any field is far off, apart."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAINT = 1e-2
"""A frame of less power than this part of the strongest's is faint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveError:
    """The error of a piece of target.

    Attributes
    ----------
    energy : float
        Root of the error's power over that of the target, all frames together.
    mean, worst : float
        Of the frames that are not faint.
    faint : int
        How many frames are.
    frames : int
        How many there are in all, without the silent ones.
    faint_mean : float
        The faint ones' error; 0 where there are none.
    """

    energy: float
    mean: float
    worst: float
    faint: int
    frames: int
    faint_mean: float

    def __str__(self) -> str:
        said = f"{100 * self.energy:.1f} % by energy; mean {100 * self.mean:.1f} %, worst {100 * self.worst:.1f} %"
        if not self.faint:
            return said
        apart = f"{said}; {self.faint} of {self.frames} frames have less than a hundredth of the loudest's power"
        if self.faint_mean <= 1:
            return f"{apart}: mean {100 * self.faint_mean:.0f} %"
        return f"{apart}: in them more comes than is asked for, --level auto makes it less"

    def plain(self) -> dict[str, object]:
        """For JSON, as ratios."""
        return {
            "E_energy": self.energy,
            "E_mean": self.mean,
            "E_worst": self.worst,
            "faint_frames": self.faint,
            "E_faint": self.faint_mean,
        }


def error_by_energy(error: Array, power: Array) -> SolveError:
    """What the errors of frames come to.

    Parameters
    ----------
    error : ndarray, shape (frame,)
        E of each frame.
    power : ndarray, shape (frame,)
        Power of each frame's target, in any unit; frames without any are left out.
    """
    plays = power > 0
    error, power = error[plays], power[plays]
    if not len(error):
        return SolveError(energy=0.0, mean=0.0, worst=0.0, faint=0, frames=0, faint_mean=0.0)
    faint = power < FAINT * power.max()
    return SolveError(
        energy=float(np.sqrt((error**2 * power).sum() / power.sum())),
        mean=float(error[~faint].mean()),
        worst=float(error[~faint].max()),
        faint=int(faint.sum()),
        frames=len(error),
        faint_mean=float(error[faint].mean()) if faint.any() else 0.0,
    )
