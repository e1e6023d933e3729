"""AUTD3's firmware emulator in virtual time, with access to every emitted phase and pulse.

Needs the extra `autd3-emulator`.
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
    """Output of the emulated transducers, one row per 25 µs."""

    phase: Bytes
    """Shape (tick, transducer), in steps of 2 pi / 256."""
    pulse_width: NDArray[np.uint16]
    """Shape (tick, transducer); 0 is silence and 256 full drive."""
    begin: int
    """Device time of the first row, in ns."""

    def row(self, instant: int) -> int:
        """Row of an instant of device time."""
        return (instant - self.begin) // TICK


class Autd3Firmware:
    """Both pattern banks of emulated units; virtual time advances only in `wait_until`."""

    emulated = True
    frames_max = commands.FRAMES_MAX
    # As with UDP, where the firmware refuses switches less than 10 ms ahead.
    margin = patience = 15_000_000
    # There is no failsafe in virtual time.
    failsafe = 0.0

    def __init__(self, placement: Placement) -> None:
        self._units, self._begin = placement.units, 1_000_000_000
        self._recorder: Recorder | None = Recorder(commands.geometry(placement), self._begin)
        self._now = self._begin
        self._playing = False

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""
        self._open.send(commands.silencer(silencer))

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive bank."""
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
        """Advance virtual time."""
        if instant > self._now:
            # The emulator advances by whole ticks only.
            ticks = -(-(instant - self._now) // TICK)
            self._open.tick(Duration.from_nanos(ticks * TICK))
            self._now += ticks * TICK

    def silence(self) -> None:
        """Set all transducers to intensity 0 at once."""
        if self._recorder is not None:
            self._recorder.send(commands.silence(self._units))
        self._playing = False

    def emitting(self) -> bool:
        """True if a switch was sent and no silence since."""
        return self._playing

    def state(self) -> None:
        """None: the emulator has no units to query."""

    def release(self) -> None:
        """Do nothing: there is no failsafe to release."""

    def describe(self) -> dict[str, str]:
        """Description of the emulated units."""
        return {
            "units": f"{self._units} emulated",
            "buffers": f"2 x {self.frames_max} patterns",
            "failsafe": "not emulated in virtual time",
        }

    def close(self) -> None:
        """Close the emulator and discard its output."""
        self._recorder = None

    def put_out(self) -> EmittedFrames:
        """Return the output from the beginning until now; ends the emulation."""
        recorder, self._recorder = self._open, None
        record = recorder.into_record()
        return EmittedFrames(
            phase=record.phase().to_numpy().T,
            pulse_width=record.pulse_width().to_numpy().T.astype(np.uint16),
            begin=self._begin,
        )

    def rms_field(self, x: tuple[float, float], y: tuple[float, float], z: float, step: float) -> NDArray[np.float64]:
        """The emulator's own sound field over its last tick, shape (point, 4): x, y, z in m and Pa rms; ends the
        emulation.

        `x` and `y` are the first and last coordinate, in m, relative to the centre of the placement; `step` is the
        pitch in m.
        """
        recorder, self._recorder = self._open, None
        record = recorder.into_record()
        grid = Grid((x[0] * 1e3, x[1] * 1e3), (y[0] * 1e3, y[1] * 1e3), z * 1e3, step * 1e3, "xyz")
        field = record.sound_field(grid, RmsRecordOption())
        places = field.observe_points().to_numpy().reshape(-1, 3) * 1e-3
        # Only the last tick, when all phases have changed to the last frame.
        field.skip(Duration.from_nanos((record.num_samples() - 1) * TICK))
        pressure = field.next(Duration.from_nanos(TICK)).to_numpy()
        return np.column_stack([places, pressure[:, -1]])

    @property
    def _open(self) -> Recorder:
        if self._recorder is None:
            raise DeviceStateError("autd3 firmware: expected a running emulation, it has ended; create a new one")
        return self._recorder
