"""A phased array that exists only here: its sound presses on a `VirtualSkin`."""

import numpy as np

from midair.devices.interface import ArrayDevice, PlayReport, Progress
from midair.devices.virtual_skin import VirtualSkin
from midair.errors import DeviceStateError, RateError
from midair.model import Drive, Medium, TransducerArray
from midair.physics import (
    Directivity,
    TransducerDynamics,
    envelope,
    quantise_phase,
    radiation_pressure,
    transfer_matrix,
)


class VirtualArray(ArrayDevice):
    """Plays frame after frame on transducers that need time, hold 8-bit phases, and are not as strong as assumed.

    That its transducers differ from the model which the solver uses is meant: without it, there would be nothing to
    measure and to correct.

    Parameters
    ----------
    array : TransducerArray
        Where the transducers are.
    skin : VirtualSkin, optional
        What the sound presses on; none by default.
    medium, directivity
        Of the sound, as in `transfer_matrix`.
    dynamics : TransducerDynamics
        How a transducer follows a change of its drive.
    phase_bits : int
        That the phases are rounded to.
    strength : float
        Mean strength of the transducers over the model's.
    spread : float
        Standard deviation of the strengths, as a part of the mean.
    seed : int
        Of the strengths.
    """

    simulated = True
    gated = False

    def __init__(
        self,
        array: TransducerArray,
        skin: VirtualSkin | None = None,
        *,
        medium: Medium | None = None,
        directivity: Directivity = "t4010a1",
        dynamics: TransducerDynamics | None = None,
        phase_bits: int = 8,
        strength: float = 0.9,
        spread: float = 0.05,
        seed: int = 0,
        name: str = "virtual",
    ) -> None:
        self.name, self.array = name, array
        self.medium, self.dynamics, self.phase_bits = medium or Medium(), dynamics or TransducerDynamics(), phase_bits
        self._skin = skin
        rng = np.random.default_rng(seed)
        self._strength = np.clip(strength * (1 + spread * rng.standard_normal(array.count)), 0, None)
        self._matrix = (
            None if skin is None else transfer_matrix(skin.points, array, medium=self.medium, directivity=directivity)
        )
        self._open = False
        self._now = np.zeros(array.count, complex)

    @property
    def emitting(self) -> bool:
        """Whether any sound comes out now."""
        return bool(np.abs(self._now).max() > 0)

    def open(self) -> None:
        """Be ready, and silent."""
        self._open = True
        self.silence()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Work out the pressure of every frame on the skin, some frames at a time."""
        if not self._open:
            raise DeviceStateError("virtual array: expected open before play")
        substeps = self._substeps(drive.rate)
        together, total = max(1, 1024 // substeps), drive.frames * repeats
        self._rest(round(delay * drive.rate), substeps)
        for before in range(0, total, drive.frames):
            for start in range(0, drive.frames, together):
                self._emit_frames(drive, slice(start, start + together), substeps)
                if progress:
                    progress(before + min(start + together, drive.frames), total)
        return PlayReport(frames=total, duration=total / drive.rate)

    def silence(self) -> None:
        """Stop all sound at once."""
        self._now = np.zeros(self.array.count, complex)

    def close(self) -> None:
        """Let go."""
        self._open = False

    def _substeps(self, rate: float) -> int:
        if self._skin is None:
            return 1
        substeps = self._skin.rate / rate
        if substeps < 1 or abs(substeps - round(substeps)) > 1e-6:
            raise RateError(
                f"drive: expected a rate that {self._skin.rate:g} Hz is a whole multiple of, got {rate:g} Hz; "
                "solve it at 1000 Hz"
            )
        return round(substeps)

    def _rest(self, frames: int, substeps: int) -> None:
        """Silence on the skin."""
        if self._skin is not None and frames:
            self._skin.press(np.zeros((frames * substeps, self._skin.points.count)))

    def _emit_frames(self, drive: Drive, frames: slice, substeps: int) -> None:
        level = drive.level[frames] if drive.level.ndim == 2 else drive.level[frames, None]
        phase = quantise_phase(drive.phase[frames], bits=self.phase_bits)
        q = np.asarray(level * np.exp(1j * phase), np.complex128)
        moving = envelope(q, drive.rate, substeps, self.dynamics, start=self._now)
        self._now = moving[-1]
        if self._skin is not None and self._matrix is not None:
            field = (moving * self._strength) @ self._matrix.T
            self._skin.press(radiation_pressure(field, self.medium))
