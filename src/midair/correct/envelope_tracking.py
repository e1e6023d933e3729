"""Pressure of transducers with envelopes at the end of each frame, and its gradient by all phases."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, Drive
from midair.physics import Transducers, radiation_pressure, transfer_matrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Waves = NDArray[np.complex64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EnvelopeTracking:
    """Map from phases to the pressure at the end of each frame, in single precision."""

    G: Waves  # Field of each transducer at full drive in Pa, shape (transducer, point)
    back: Waves  # Conjugate transpose of the field, shape (point, transducer)
    weights: Single  # Radiation pressure at each place of 1 Pa of sound at each point, in Pa, shape (point, place)
    stays: Waves  # Remainder of a transducer's output after one frame, shape (transducer,)
    comes: Waves  # Output after one frame of a drive of 1, shape (transducer,)

    @classmethod
    def of(
        cls,
        drive: Drive,
        transducers: Transducers,
        grid: ControlGrid,
        weights: Array,
    ) -> "EnvelopeTracking":
        """Make it for a drive's array and air, these transducers, and weights (place, point) of places on a grid."""
        G = transfer_matrix(grid, drive.array.nominal, acoustics=drive.acoustics)
        unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
        stays = np.exp(transducers.pole / drive.rate)
        return cls(
            G=np.ascontiguousarray(G.T, np.complex64),
            back=np.ascontiguousarray(G.conj(), np.complex64),
            weights=np.ascontiguousarray(unit * weights.T, np.float32),
            stays=stays.astype(np.complex64),
            comes=((1 - stays) * transducers.response).astype(np.complex64),
        )

    def radiated(self, command: Waves, start: Waves) -> Waves:
        """Output of each transducer at the end of each frame, (frame, transducer); `start` before the first."""
        q, now = self.comes * command, start
        for frame in q:
            frame += self.stays * now
            now = frame
        return q

    def cost(self, command: Waves, start: Waves, wanted: Single, metric: Single) -> tuple[float, Single]:
        """The cost ``sum((P - P') * metric (P - P')) / 2``, and its gradient by the phases, (frame, transducer).

        `command` (frame, transducer) is c as a fraction of full drive; `start` (transducer,) the output before the
        first frame; `wanted` (frame, place) P' in Pa; `metric` (frame, frame) the symmetric weights.
        """
        y = self.radiated(command, start) @ self.G
        missed = (y.real**2 + y.imag**2) @ self.weights - wanted
        felt = metric @ missed
        # Backward in time, with the slope of the cost by the output in each frame.
        slope: Any = ((2 * (felt @ self.weights.T)) * y) @ self.back
        later, stays = np.zeros_like(start), self.stays.conj()
        for frame in slope[::-1]:
            frame += stays * later
            later = frame
        slope *= self.comes.conj()
        turned = slope.imag * command.real - slope.real * command.imag
        return 0.5 * float(np.vdot(missed.astype(np.float64), felt)), turned
