"""AUTD3's firmware emulator in virtual time, with access to every emitted phase and pulse."""

from dataclasses import dataclass

import numpy as np
import pytest

from midair.devices import BankedArray
from midair.devices.arrays.banks import Banks, TooLateError
from midair.devices.frame_bytes import TICK
from midair.errors import DeviceStateError
from midair.model import Placement

autd3_core = pytest.importorskip("autd3_core")
autd3_emulator = pytest.importorskip("autd3_emulator")
commands = pytest.importorskip("midair.devices.arrays.autd3_commands")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EmittedFrames:
    """Output of the emulated transducers, shape (tick, transducer), one row per 25 µs; `begin` is device time in ns.

    `phase` is in steps of 2 pi / 256; a `pulse_width` of 0 is silence and 256 full drive.
    """

    phase: np.ndarray
    pulse_width: np.ndarray
    begin: int

    def row(self, instant):
        """Row of an instant of device time."""
        return (instant - self.begin) // TICK


class Autd3Firmware(Banks):
    """Both pattern banks of emulated units; virtual time advances only in `wait_until`."""

    emulated = True
    frames_max = commands.FRAMES_MAX
    # As with UDP, where the firmware refuses switches less than 10 ms ahead.
    margin = patience = 15_000_000
    # There is no failsafe in virtual time.
    failsafe = 0.0

    def __init__(self, placement):
        self._units, self._begin = placement.units, 1_000_000_000
        self._recorder = autd3_emulator.Recorder(commands.geometry(placement), self._begin)
        self._now = self._begin
        self._playing = False

    def set_silencer(self, silencer):
        self._open.send(commands.silencer(silencer))

    def load(self, bank, phases, intensity, divider):
        for command in commands.load(bank, phases, intensity, divider):
            self._open.send(command)

    def switch(self, bank, instant):
        try:
            self._open.send(commands.switch(bank, instant))
        except autd3_core.Autd3Error as wrong:
            raise TooLateError(str(wrong)) from wrong
        self._playing = True

    def now(self):
        return self._now

    def wait_until(self, instant):
        if instant > self._now:
            # The emulator advances by whole ticks only.
            ticks = -(-(instant - self._now) // TICK)
            self._open.tick(autd3_core.Duration.from_nanos(ticks * TICK))
            self._now += ticks * TICK

    def silence(self):
        if self._recorder is not None:
            self._recorder.send(commands.silence(self._units))
        self._playing = False

    def emitting(self):
        return self._playing

    def describe(self):
        return {"units": f"{self._units} emulated"}

    def close(self):
        self._recorder = None

    def put_out(self):
        """Return the output from the beginning until now; ends the emulation."""
        record = self._ended()
        return EmittedFrames(
            phase=record.phase().to_numpy().T,
            pulse_width=record.pulse_width().to_numpy().T.astype(np.uint16),
            begin=self._begin,
        )

    def rms_field(self, x, y, z, step):
        """The emulator's own field over its last tick, shape (point, 4): x, y, z in m and Pa rms; ends the emulation.

        `x` and `y` are the first and last coordinate, in m, relative to the centre of the placement; `step` is the
        pitch in m.
        """
        record = self._ended()
        grid = autd3_emulator.Grid((x[0] * 1e3, x[1] * 1e3), (y[0] * 1e3, y[1] * 1e3), z * 1e3, step * 1e3, "xyz")
        field = record.sound_field(grid, autd3_emulator.RmsRecordOption())
        places = field.observe_points().to_numpy().reshape(-1, 3) * 1e-3
        # Only the last tick, when all phases have changed to the last frame.
        field.skip(autd3_core.Duration.from_nanos((record.num_samples() - 1) * TICK))
        pressure = field.next(autd3_core.Duration.from_nanos(TICK)).to_numpy()
        return np.column_stack([places, pressure[:, -1]])

    def _ended(self):
        recorder, self._recorder = self._open, None
        return recorder.into_record()

    @property
    def _open(self):
        if self._recorder is None:
            raise DeviceStateError("autd3 firmware: expected open before use")
        return self._recorder


def autd3_firmware(placement=None, *, silencer="off"):
    """An array on the firmware's emulator; ``.units.put_out()`` returns the output of the transducers."""
    placement = placement or Placement.grid()
    return BankedArray(Autd3Firmware, placement, name="autd3:firmware", silencer=silencer, simulated=True)
