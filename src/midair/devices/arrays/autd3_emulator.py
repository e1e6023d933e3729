"""AUTD3's firmware emulator in virtual time: every phase and pulse that the transducers would put out is read back.

Imports the extra `autd3-emulator`.
"""

from dataclasses import dataclass

import numpy as np
from autd3_core import Autd3Error, Duration
from autd3_emulator import Grid, Recorder, RmsRecordOption
from numpy.typing import NDArray

from midair.devices.arrays import autd3_commands as commands
from midair.devices.arrays.banks import TooLateError
from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import TICK, Bytes
from midair.errors import DeviceStateError
from midair.model import Placement


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EmittedFrames:
    """What the emulated transducers put out, a row each 25 µs.

    Attributes
    ----------
    phase : ndarray of uint8, shape (tick, transducer)
        In steps of 2 pi / 256.
    pulse_width : ndarray of uint16, shape (tick, transducer)
        0 is silence and 256 full drive.
    begin : int
        Device time of the first row, in ns.
    """

    phase: Bytes
    pulse_width: NDArray[np.uint16]
    begin: int

    def row(self, instant: int) -> int:
        """The row of an instant of device time."""
        return (instant - self.begin) // TICK


class Autd3Firmware:
    """Both pattern banks of emulated units; its clock runs when it is waited for.

    Parameters
    ----------
    placement : Placement
        One entry a unit.
    """

    emulated = True
    frames_max = commands.FRAMES_MAX
    # As over UDP, where the firmware refuses switches less than 10 ms ahead.
    margin = patience = 15_000_000
    # The host of an emulation in virtual time is never silent.
    failsafe = 0.0

    def __init__(self, placement: Placement) -> None:
        self._units, self._begin = placement.units, 1_000_000_000
        self._recorder: Recorder | None = Recorder(commands.geometry(placement), self._begin)
        self._now = self._begin
        self._playing = False

    def set_silencer(self, silencer: Silencer) -> None:
        """Set over how long the firmware spreads steps."""
        self._open.send(commands.silencer(silencer))

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns and then a silent one into a bank that does not play."""
        for command in commands.load(bank, phases, intensity, divider):
            self._open.send(command)

    def switch(self, bank: int, instant: int) -> None:
        """Play a bank once, from an instant on."""
        try:
            self._open.send(commands.switch(bank, instant))
        except Autd3Error as wrong:
            raise TooLateError(str(wrong)) from wrong
        self._playing = True

    def now(self) -> int:
        """Device time, in ns."""
        return self._now

    def wait_until(self, instant: int) -> None:
        """Let virtual time pass."""
        if instant > self._now:
            # The emulator knows whole ticks only.
            ticks = -(-(instant - self._now) // TICK)
            self._open.tick(Duration.from_nanos(ticks * TICK))
            self._now += ticks * TICK

    def silence(self) -> None:
        """All transducers to intensity 0 at once."""
        if self._recorder is not None:
            self._recorder.send(commands.silence(self._units))
        self._playing = False

    def emitting(self) -> bool:
        """Whether a switch was ordered and no silence since."""
        return self._playing

    def state(self) -> None:
        """NoArguments: a recorder answers no questions."""

    def release(self) -> None:
        """Nothing to release."""

    def describe(self) -> dict[str, str]:
        """Say what is emulated, and what is not."""
        return {
            "units": f"{self._units} emulated",
            "buffers": f"2 x {self.frames_max} patterns",
            "failsafe": "not emulated in virtual time",
        }

    def close(self) -> None:
        """Let go; what was put out is gone."""
        self._recorder = None

    def put_out(self) -> EmittedFrames:
        """Everything from the beginning until now. Ends the emulation."""
        recorder, self._recorder = self._open, None
        record = recorder.into_record()
        return EmittedFrames(
            phase=record.phase().to_numpy().T,
            pulse_width=record.pulse_width().to_numpy().T.astype(np.uint16),
            begin=self._begin,
        )

    def rms_field(self, x: tuple[float, float], y: tuple[float, float], z: float, step: float) -> NDArray[np.float64]:
        """The emulator's own sound field over its last tick, rms. Ends the emulation.

        Parameters
        ----------
        x, y : tuple of float
            First and last coordinate, in m, in the coordinates of the placement once centred.
        z : float
            In m.
        step : float
            Distance between points, in m.

        Returns
        -------
        ndarray, shape (point, 4)
            x, y, z in m, and Pa rms.
        """
        recorder, self._recorder = self._open, None
        record = recorder.into_record()
        grid = Grid((x[0] * 1e3, x[1] * 1e3), (y[0] * 1e3, y[1] * 1e3), z * 1e3, step * 1e3, "xyz")
        field = record.sound_field(grid, RmsRecordOption())
        places = field.observe_points().to_numpy().reshape(-1, 3) * 1e-3
        # Only the last tick, when phases have arrived and no frame is mixed with the one before.
        field.skip(Duration.from_nanos((record.num_samples() - 1) * TICK))
        pressure = field.next(Duration.from_nanos(TICK)).to_numpy()
        return np.column_stack([places, pressure[:, -1]])

    @property
    def _open(self) -> Recorder:
        if self._recorder is None:
            raise DeviceStateError("autd3 firmware: expected an emulation that has not ended; make a new one")
        return self._recorder
