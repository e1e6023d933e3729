"""Error of a solution by energy and by frame; faint frames with large relative errors count separately."""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Array

FAINT = 1e-2
"""Frames with less than this part of the strongest frame's power are faint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveError:
    """Error of a solved target."""

    energy: float
    """Root of the error's power over the target's power, all frames together."""
    mean: float
    """Mean over the frames that are not faint."""
    worst: float
    """Maximum over the frames that are not faint."""
    faint: int
    """Number of faint frames."""
    frames: int
    """Number of all frames that are not silent."""
    faint_mean: float
    """Mean error of the faint frames; 0 without any."""

    def __str__(self) -> str:
        said = f"{100 * self.energy:.1f} % by energy; mean {100 * self.mean:.1f} %, worst {100 * self.worst:.1f} %"
        if not self.faint:
            return said
        apart = f"{said}; {self.faint} of {self.frames} frames have less than a hundredth of the loudest's power"
        if self.faint_mean <= 1:
            return f"{apart}: mean {100 * self.faint_mean:.0f} %"
        return f"{apart}: there the output exceeds the target, --level auto reduces it"

    def plain(self) -> dict[str, object]:
        """Ratios for JSON."""
        return {
            "E_energy": self.energy,
            "E_mean": self.mean,
            "E_worst": self.worst,
            "faint_frames": self.faint,
            "E_faint": self.faint_mean,
        }


def error_by_energy(error: Array, power: Array) -> SolveError:
    """Summarise the errors E of frames, weighted with their targets' power in any unit; silent frames are ignored."""
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
