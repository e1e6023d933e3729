"""AUTD3 units with firmware before series 0.12, over EtherCAT; needs the extra `pyautd3`, version 36 or 38.

Version 36 is for firmware v10 and later and accesses the bus directly (ethercrab); version 38 needs Python 3.12, is for
firmware v12.1, and uses TwinCAT or a server on another machine.

The SDK requests each transducer's drive by a callback. A Python callback takes 200 ms per frame, a compiled one that
reads a table .1 ms. It uses `gain_custom` of the SDK's C interface, which may change: hence the narrow version range of
the extra.
"""

# The SDK has no types for strict checking.
# pyright: basic

import contextlib
import ctypes
import importlib
import time
from threading import RLock

import numpy as np
from numba import cfunc, types
from pyautd3 import (
    AUTD3,
    Controller,
    DcSysTime,
    Duration,
    FixedCompletionTime,
    FixedUpdateRate,
    GainSTM,
    GainSTMOption,
    Null,
    ReadsFPGAState,
    SamplingConfig,
    Segment,
    SenderOption,
    SwapSegmentGainSTM,
    WithFiniteLoop,
    WithSegment,
    transition_mode,
)
from pyautd3 import Silencer as SetSilencer
from pyautd3.autd_error import AUTDError
from pyautd3.driver.datagram.gain import Gain
from pyautd3.link import remote
from pyautd3.link.audit import Audit
from pyautd3.link.nop import Nop
from pyautd3.link.twincat import TwinCAT
from pyautd3.native_methods.autd3capi import NativeMethods

from midair.devices.arrays.banks import Banks, TooLateError, UnitsState
from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.errors import DeviceError, DeviceStateError, LinkLostError, UnknownDeviceError
from midair.model import UNIT, Placement

SEGMENTS = Segment.S0, Segment.S1

YEAR_2000 = 946_684_800_000_000_000
"""Origin of EtherCAT's distributed clocks, in ns of Unix time."""


@cfunc(types.void(types.CPointer(types.uint8), types.voidptr, types.uint16, types.uint8, types.CPointer(types.uint8)))
def _look_up(table, _, unit, transducer, drive):
    """Read one transducer's phase and intensity from a table, shape (unit, transducer, 2)."""
    at = (np.intp(unit) * 249 + np.intp(transducer)) * 2
    drive[0] = table[at]
    drive[1] = table[at + 1]


class _TableGain(Gain):
    """One frame that the SDK reads from a table."""

    def __init__(self, phases: Bytes, intensity: Bytes) -> None:
        super().__init__()
        self._table = np.ascontiguousarray(np.stack([phases, np.broadcast_to(intensity, phases.shape)], axis=-1))

    def _gain_ptr(self, geometry):
        context = ctypes.c_void_p(self._table.ctypes.data)
        return NativeMethods().gain_custom(ctypes.c_void_p(_look_up.address), context, geometry._geometry_ptr)


class PyAutd3Banks(Banks):
    """Both segments of all units; `placement` lists the units in the order of the wiring, `link` as in `pyautd3_array`.

    A datagram, which carries one pattern, takes the SDK's 1 ms on a real bus, too slow for 1000 patterns per second,
    and 0.5 ms without a bus.
    """

    frames_max = 1024
    margin = patience = 30_000_000
    failsafe = 0.0

    def __init__(self, placement: Placement, link: str) -> None:
        self._lock, self._lost, self._ordered = RLock(), "", False
        self._units, self.emulated = placement.units, link in ("audit", "nop")
        units = [AUTD3(pos=at, rot=turn) for at, turn in zip(placement.origin * 1e3, placement.quaternion, strict=True)]
        self.link = self._link(link)
        try:
            self._controller: Controller | None = Controller.open(units, self.link)
            # The wall clock is read once; from then on the units' clocks run freely.
            self._begin = time.time_ns() - YEAR_2000 - time.monotonic_ns()  # noqa: TID251
            between = Duration.from_nanos(500_000 if self.emulated else 1_000_000)
            self._controller.default_sender_option = SenderOption(send_interval=between, receive_interval=between)
            # Units report whether they play only on request.
            self._send(ReadsFPGAState(lambda _: True))
            self.silence()
        except AUTDError as wrong:
            raise DeviceError(f"pyautd3: {wrong}; {_ADVICE}") from wrong

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""
        if silencer.phase == 0:
            return self._send(SetSilencer(FixedUpdateRate(intensity=65535, phase=65535)))
        intensity, phase = (Duration.from_nanos(round(each * 1e9)) for each in (silencer.intensity, silencer.phase))
        return self._send(SetSilencer(FixedCompletionTime(intensity=intensity, phase=phase, strict=False)))

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive segment."""
        gains = [_TableGain(phase, strength) for phase, strength in zip(phases, intensity, strict=True)]
        gains.append(_TableGain(np.zeros((self._units, UNIT), np.uint8), np.zeros(1, np.uint8)))
        sequence = GainSTM(gains, SamplingConfig(divider), GainSTMOption())
        # `Later` writes the segment without playing it; `switch` plays it.
        self._send(WithFiniteLoop(sequence, SEGMENTS[bank], transition_mode.Later(), 1))

    def switch(self, bank: int, instant: int) -> None:
        """Play a segment once, from an instant on."""
        try:
            self._send(SwapSegmentGainSTM(SEGMENTS[bank], transition_mode.SysTime(_device_time(instant))))
        except DeviceError as wrong:
            if "transition" in str(wrong).lower():
                raise TooLateError(str(wrong)) from None
            raise
        self._ordered = True

    def now(self) -> int:
        """Device time, in ns."""
        return self._begin + time.monotonic_ns()

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise as soon as a unit is lost."""
        while (left := instant - self.now()) > 0:
            self._check()
            time.sleep(min(left * 1e-9, 0.02))
        self._check()

    def silence(self) -> None:
        """Set all transducers to intensity 0 at once."""
        self._send(WithSegment(Null(), Segment.S0, transition_mode.Immediate()))
        self._ordered = False

    def emitting(self) -> bool:
        """True if a unit reports that a sequence plays.

        The clock of version 38's audit and nop links does not advance, so that a switch never takes effect; for these,
        True if a switch was sent and no silence since.
        """
        if self._controller is None:
            return False
        if isinstance(self.link, Audit | Nop) and not hasattr(DcSysTime, "now"):
            return self._ordered
        with self._lock:
            states = self._controller.fpga_state()
        return any(state is not None and state.is_stm_mode() for state in states)

    def state(self) -> UnitsState:
        """Temperature state; firmware before series 0.12 does not report a failsafe."""
        with self._lock:
            states = self._open.fpga_state()
        hot = (unit for unit, state in enumerate(states) if state is not None and state.is_thermal_assert())
        return UnitsState(hot=tuple(hot))

    def describe(self) -> dict[str, str]:
        """Information from the units."""
        with self._lock:
            versions = self._open.firmware_version()
        return {
            "units": f"{len(versions)} answer",
            "firmware": ", ".join(sorted({str(one) for one in versions})),
            "buffers": f"2 x {self.frames_max} patterns",
            "failsafe": "none that this SDK can ask about",
        }

    def close(self) -> None:
        """Silence the units, as the SDK does on closing, and close the link."""
        controller, self._controller = self._controller, None
        if controller is not None:
            with contextlib.suppress(AUTDError):  # a lost unit cannot be reached
                controller.close()

    @property
    def _open(self) -> Controller:
        if self._controller is None:
            raise DeviceStateError("pyautd3: expected open before use")
        return self._controller

    def _link(self, name: str):
        kind, _, address = name.partition(":")
        match kind:
            case "audit":
                return Audit()
            case "nop":
                return Nop()
            case "twincat":
                return TwinCAT()
            case "remote" if address:
                return remote.Remote(address, *_later_option(remote, "RemoteOption"))
            case "ethercrab":
                try:
                    ethercrab = importlib.import_module("pyautd3.link.ethercrab")
                except ImportError:
                    raise UnknownDeviceError(
                        "pyautd3: expected version 36 for the link ethercrab, got a later one without it; "
                        "use twincat or remote:ADDRESS:PORT, or Python 3.11 and pip install 'pyautd3==36.0.2'"
                    ) from None
                return ethercrab.EtherCrab(self._on_lost, ethercrab.EtherCrabOption(ifname=address or None))
            case _:
                raise UnknownDeviceError(
                    "pyautd3: expected the link audit, nop, twincat, remote:ADDRESS:PORT or ethercrab[:INTERFACE], "
                    f"got {name!r}"
                )

    def _on_lost(self, unit: int, status: object) -> None:
        self._lost = f"unit {unit}: {status}"

    def _check(self) -> None:
        if self._lost:
            raise LinkLostError(f"pyautd3: {self._lost}; {_ADVICE}, then play again")

    def _send(self, datagram) -> None:
        with self._lock:
            try:
                self._open.send(datagram)
            except AUTDError as wrong:
                raise DeviceError(f"pyautd3: {wrong}; {_ADVICE}") from wrong


def _later_option(module, name: str) -> list:
    """The default of an option that version 38 requires and version 36 does not have."""
    return [getattr(module, name)()] if hasattr(module, name) else []


def _device_time(instant: int) -> DcSysTime:
    """Convert an instant in ns of device time; version 36 supports only addition."""
    if not hasattr(DcSysTime, "now"):
        return DcSysTime(instant)  # pyright: ignore[reportCallIssue]
    return DcSysTime.ZERO + Duration.from_nanos(instant)


_ADVICE = "check cables and power (up to 50 W a unit), the interface's name, and the permission for raw sockets"
