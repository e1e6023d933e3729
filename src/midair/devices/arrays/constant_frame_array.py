"""A constant frame, for aiming and measuring, on units whose failsafe supervises the player.

Two banks that end in silence would have to be rewritten continuously for a constant frame. Instead, a single pattern is
sent, which sounds until the next one. The SDK's heartbeat, which comes from its own thread, would keep it on while
Python hangs: here it is off, the failsafe is shorter, and the player sends a message every 10 ms.
"""

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from midair.devices.arrays.banks import Units, UnitsArray, UnitsState, name_units
from midair.devices.frame_bytes import Bytes, divider, intensity_bytes, phase_bytes
from midair.devices.interface import PlayReport
from midair.errors import InputError, SilentFramesError
from midair.model import Drive, Placement, Progress


class ConstantFrameUnits(Units, Protocol):
    """Units that hold a single pattern."""

    def stand(self, phases: Bytes, intensity: Bytes) -> None:
        """Play a pattern until another one arrives; shape (unit, transducer of the unit) each."""

    def state(self) -> UnitsState:
        """Current state of the units; the query also resets the failsafe timer."""
        ...


class ConstantFrameArray(UnitsArray[ConstantFrameUnits]):
    """Plays drives with identical frames as one constant pattern.

    `connect` opens the units, without a heartbeat and with a short failsafe. `word` is the interval of messages to the
    units, in s, far below their failsafe. The other parameters are those of `ImmediateArray`.
    """

    def __init__(
        self,
        connect: Callable[[Placement], ConstantFrameUnits],
        placement: Placement,
        *,
        name: str,
        exclusive: str | None = None,
        word: float = 0.01,
    ) -> None:
        super().__init__(connect, placement, name=name, exclusive=exclusive)
        self._word = word

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Play the frame for the duration of the drive; raises InputError if the frames differ."""
        divider(drive.rate)
        phases, intensity = phase_bytes(drive, self.placement.units), intensity_bytes(drive, self.placement.units)
        if (phases != phases[0]).any() or (intensity != intensity[0]).any():
            raise InputError(f"{self.name}: expected identical frames, got a drive that changes; play it on autd3")
        units, total = self.units, drive.frames * repeats
        units.silence()
        units.state().check_heat()
        # Without a heartbeat the failsafe has acted since the last order.
        units.release()
        self._wait(units, delay)
        with self.sounding():
            units.stand(phases[0], np.broadcast_to(intensity[0], phases[0].shape))
            self._sounds = True
        begun = time.monotonic()
        state = self._hold(units, begun, total, drive.rate, progress)
        return PlayReport(frames=total, duration=total / drive.rate, units=str(state))

    def silence(self) -> None:
        """Stop all sound immediately, from any thread."""
        self._sounds = False
        if self._units is not None:
            self._units.silence()

    def _wait(self, units: ConstantFrameUnits, delay: float) -> None:
        end = time.monotonic() + delay
        while (left := end - time.monotonic()) > 0:
            units.state().check_heat()
            time.sleep(min(left, self._word))

    def _hold(
        self, units: ConstantFrameUnits, begun: float, total: int, rate: float, progress: Progress | None
    ) -> UnitsState:
        well = begun
        while True:
            asked = time.monotonic()
            with self.sounding():
                state = units.state()
            done = int((asked - begun) * rate)
            state.check_heat(f"after {min(done, total)} of {total} frames ({min(done, total) / rate:.3f} s)")
            if state.silenced:
                first = min(total, int((well - begun) * rate))
                raise SilentFramesError(
                    f"{self.name}: expected a constant frame, but the failsafe silenced "
                    f"{name_units(state.silenced)}: frames {first} to {total - 1} of {total} "
                    f"({first / rate:.3f} to {total / rate:.3f} s) may not have sounded"
                )
            well = asked
            if progress:
                progress(min(done, total), total)
            if done >= total:
                return state
            time.sleep(min(self._word, max(0.0, total / rate - (time.monotonic() - begun))))
