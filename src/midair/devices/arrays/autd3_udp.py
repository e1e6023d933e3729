"""AUTD3 units of firmware series 0.12 over Ethernet, or their emulator over loopback; needs the extra `autd3`.

While the link is open, the SDK sends a heartbeat every 10 ms from its own thread. When the process dies the heartbeats
end, and the device's failsafe silences it after half a second.
"""

import asyncio
import contextlib
import threading
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from typing import TypeVar

from autd3 import Autd3Error, Client, ClientConfig, Duration, Interface, ServerLink, Telemetry, UdpEmulator, UdpOption
from autd3.commands import CpuConfig, ReleaseFailsafe, SetCpuConfig

from midair.devices.arrays import autd3_commands as commands
from midair.devices.arrays.autd3 import Autd3Address
from midair.devices.arrays.banks import TooLateError, UnitsState
from midair.devices.arrays.silencer import Silencer
from midair.devices.frame_bytes import Bytes
from midair.errors import DeviceError, DeviceStateError, LinkLostError, UnknownDeviceError
from midair.model import Placement

T = TypeVar("T")

FAILSAFE = 0.5
"""Time without traffic after which the device silences itself, in s."""

ANSWER = 0.05
"""Time limit for the units' answer to a datagram, in s; it normally arrives within 1 ms."""

ATTEMPTS = 5
"""Number of attempts before the link counts as lost: a quarter of a second, as long as a block lasts."""

GROUP = 5
"""Commands that are repeated together after a lost datagram; a block of 250 frames has 52."""

ERROR_COUNTERS = (
    "failsafe",
    "ptp_unlock_failsafe",
    "cpu_watchdog",
    "boot_failure",
    "dispatch_error",
    "fifo_drop",
    "send_failure",
    "exec_late",
    "sync_resync",
)
"""Counters of a unit that indicate errors; the others count traffic, or errors that the SDK corrects."""


class Autd3Udp:
    """Both pattern banks of all units over UDP.

    `placement` lists the units in the order of the wiring. `failsafe` is the time without a message after which the
    units silence themselves, in s. With `heartbeat` the SDK sends a message every 10 ms by itself, even while Python
    hangs.
    """

    frames_max = commands.FRAMES_MAX
    margin = 15_000_000
    """The firmware refuses switches less than 10 ms ahead."""
    patience = 75_000_000

    def __init__(
        self, placement: Placement, place: Autd3Address, *, failsafe: float = FAILSAFE, heartbeat: bool = True
    ) -> None:
        self._units, self._repetitions = placement.units, 0
        self.failsafe, self._heartbeat = failsafe, Duration.from_millis(10) if heartbeat else None
        self._emulator = UdpEmulator(placement.units) if place.kind == "emulator" else None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="autd3", daemon=True)
        self._thread.start()
        try:
            link = self._link(place)
            # A lost unit stays silent until it is opened again: no automatic recovery.
            options = ClientConfig(
                ack_timeout=Duration.from_secs_f64(ANSWER),
                resynchronize_on_recovery=None,
                release_failsafe_on_recovery=None,
            )
            client = self._repeatable(lambda: Client.open(commands.geometry(placement), link, options), 60)
            self._client: Client | None = client
            self._state = client.state_checker()
            config = CpuConfig(failsafe_timeout=Duration.from_secs_f64(failsafe))
            self._repeatable(lambda: client.send(SetCpuConfig(config)), 5)
            self.silence()
            versions = self._repeatable(client.read_firmware_version, 5)
            self.emulated = all(one.is_emulator() for one in versions)
            self._counted = self._repeatable(client.read_telemetry, 5)
        except BaseException:
            # Also after Ctrl-C: the loop's thread must not outlive a device that failed to open.
            self._client = None
            self._end_loop()
            raise

    def set_silencer(self, silencer: Silencer) -> None:
        """Set the firmware's silencer."""
        self._send([commands.silencer(silencer)])

    def load(self, bank: int, phases: Bytes, intensity: Bytes, divider: int) -> None:
        """Write patterns, followed by a silent one, into the inactive bank."""
        self._send(commands.load(bank, phases, intensity, divider))

    def switch(self, bank: int, instant: int) -> None:
        """Play a bank once, from an instant on."""
        before = self._repetitions
        try:
            self._repeatable(lambda: self._open.send(commands.switch(bank, instant)), 2)
        except DeviceError as wrong:
            if "too close to now" not in str(wrong):
                raise
            if self._repetitions > before:
                # Units that received the first order would play before the others.
                self.silence(bank=1 - bank)
            raise TooLateError(str(wrong)) from None

    def now(self) -> int:
        """Device time, in ns."""
        return self._open.device_time_now().sys_time

    def wait_until(self, instant: int) -> None:
        """Return at an instant, or raise as soon as a unit is lost."""
        while (left := instant - self.now()) > 0:
            self._check()
            # Short sleeps, so that a lost unit is noticed at once.
            time.sleep(min(left * 1e-9, 0.02))
        self._check()

    def silence(self, *, bank: int = 0) -> None:
        """Set all transducers to intensity 0 at once, with a pattern that overwrites a bank."""
        self._repeatable(lambda: self._open.send(commands.silence(self._units, bank)), 2)

    def emitting(self) -> bool:
        """True if a unit reports that patterns play."""
        states = self._repeatable(self._open.read_fpga_state, 2)
        return any(
            state.is_stm_mode() and not state.is_pattern_stopped() and not state.is_failsafe_active()
            for state in states
        )

    def state(self) -> UnitsState:
        """Current state of the units."""
        client = self._open
        states, counted = self._repeatable(client.read_fpga_state, 2), self._repeatable(client.read_telemetry, 2)
        again = [f"{self._repetitions} orders sent again"] if self._repetitions else []
        return UnitsState(
            silenced=tuple(unit for unit, state in enumerate(states) if state.is_failsafe_active()),
            hot=tuple(unit for unit, state in enumerate(states) if state.is_thermal_asserted()),
            errors=(*_error_increments(self._counted, counted), *again),
        )

    def release(self) -> None:
        """Release the failsafe of the units."""
        self._repeatable(lambda: self._open.send(ReleaseFailsafe()), 2)

    def describe(self) -> dict[str, str]:
        """Firmware, link and failsafe of the units."""
        client = self._open
        versions = self._repeatable(client.read_firmware_version, 5)
        telemetry, bus = self._repeatable(client.read_telemetry, 5), client.bus_stats()
        worst, heat = bus.worst_ack_latency_ns(), self._repeatable(client.read_fpga_state, 5)
        series = ".".join(str(part) for part in versions[0].SUPPORTED_SERIES)
        return {
            "units": f"{len(versions)} answer",
            "firmware": ", ".join(sorted({f"{one.cpu}/{one.fpga}" for one in versions}))
            + (" (emulator)" if versions[0].is_emulator() else "")
            + ("" if all(one.is_supported() for one in versions) else f", but the SDK supports {series}"),
            "link": f"{bus.frames()} frames, worst answer {worst * 1e-6:.2f} ms, "
            f"{bus.missed_heartbeat_replies()} heartbeats missed",
            "buffers": f"2 x {self.frames_max} patterns",
            "failsafe": f"after {self.failsafe:g} s without traffic; "
            f"it acted {max(one.failsafe for one in telemetry)} times since the link was opened",
            "temperature": "too hot" if any(one.is_thermal_asserted() for one in heat) else "fine",
        }

    def close(self) -> None:
        """Silence the units, as the SDK does on closing, and close the link."""
        client, self._client = self._client, None
        if client is None:
            return
        try:
            with contextlib.suppress(DeviceError):  # a lost unit cannot be reached: its own failsafe silences it
                self._call(client.close, 5)
        finally:
            self._end_loop()
            self._emulator = None

    @property
    def _open(self) -> Client:
        if self._client is None:
            raise DeviceStateError("autd3: expected open before use")
        return self._client

    def _link(self, place: Autd3Address) -> UdpOption | ServerLink:
        if self._emulator is not None:
            return self._loopback(self._emulator.option().iface)
        match place.kind:
            case "server" if self._heartbeat is None:
                raise UnknownDeviceError(
                    "autd3-server: expected a direct link to the units; a server's heartbeat keeps them on"
                )
            case "server":
                return ServerLink(place.port)
            case "simulator":
                return self._loopback(Interface.Simulator(place.port))
            case "address" if place.simulated:
                return self._loopback(Interface.Addr(place.name))
            case "address":
                return UdpOption(iface=Interface.Addr(place.name), heartbeat=self._heartbeat)
            case "interface":
                return UdpOption(iface=Interface.Name(place.name), heartbeat=self._heartbeat)
            case _:
                return UdpOption(heartbeat=self._heartbeat)

    def _loopback(self, interface: Interface) -> UdpOption:
        """Options for emulated units, which appear at once, but do not answer within the 1 ms of real ones."""
        return UdpOption(
            iface=interface,
            heartbeat=self._heartbeat,
            enumeration_timeout=Duration.from_secs(1),
            sync_timeout=Duration.from_secs(5),
            # On a busy computer an emulator may be delayed; real units are not.
            lost_timeout=Duration.from_millis(400),
            reply_timeout=Duration.from_secs_f64(ANSWER),
        )

    def _send(self, many: Sequence[commands.Command]) -> None:
        for first in range(0, len(many), GROUP):
            self._repeatable(lambda group=many[first : first + GROUP]: self._open.send(group), 10)

    def _check(self) -> None:
        status = self._state.check()
        if status.any_lost:
            lost = [number for number, state in enumerate(status.devices) if str(state).endswith("Lost")]
            raise LinkLostError(
                f"autd3: expected {self._units} units to answer, lost {lost or 'some'}; they silence themselves within "
                f"{self.failsafe:g} s; check cables and power (up to 50 W a unit), then play again"
            )

    def _repeatable(self, begin: Callable[[], Awaitable[T]], timeout: float) -> T:
        """Execute a repeatable command, and repeat it if no answer arrives, as after a lost datagram.

        The SDK repeats nothing by itself, and resynchronises units and computer before the next command.
        """
        for _ in range(ATTEMPTS - 1):
            try:
                return self._call(begin, timeout)
            except LinkLostError as wrong:
                if not (isinstance(wrong.__cause__, Autd3Error) and wrong.__cause__.code == Autd3Error.TIMEOUT):
                    raise
            self._repetitions += 1
        return self._call(begin, timeout)

    def _call(self, begin: Callable[[], Awaitable[T]], timeout: float) -> T:
        """Run an SDK call on its event loop, from any thread, and wait for the result."""

        async def wait() -> T:
            return await begin()

        # Called on the loop itself, as the SDK requires.
        future = asyncio.run_coroutine_threadsafe(wait(), self._loop)
        try:
            return future.result(timeout)
        except Autd3Error as wrong:
            kind = LinkLostError if wrong.code in (Autd3Error.NETWORK, Autd3Error.TIMEOUT) else DeviceError
            raise kind(f"autd3: {wrong}; {_advice(wrong)}") from wrong
        except TimeoutError:
            future.cancel()
            raise LinkLostError(
                f"autd3: expected an answer within {timeout:g} s, got none; run midair doctor"
            ) from None
        except BaseException:
            future.cancel()
            raise

    def _end_loop(self) -> None:
        async def end() -> None:
            for task in asyncio.all_tasks() - {asyncio.current_task()}:
                task.cancel()
            self._loop.call_soon(self._loop.stop)

        asyncio.run_coroutine_threadsafe(end(), self._loop)
        self._thread.join(2)
        if not self._thread.is_alive():
            self._loop.close()


def _error_increments(before: list[Telemetry], now: list[Telemetry]) -> Iterator[str]:
    """Increments of each unit's error counters, as text."""
    for unit, (old, new) in enumerate(zip(before, now, strict=True)):
        for name in ERROR_COUNTERS:
            if more := getattr(new, name) - getattr(old, name):
                yield f"unit {unit} counted {name} {more} times"


def _advice(wrong: Autd3Error) -> str:
    """Advice for an error of the SDK, by its code."""
    match wrong.code:
        case Autd3Error.NETWORK if "answered one Discover" in str(wrong):
            return (
                "datagrams arrive twice: connect the units to a card of their own, without switch, mirrored port or "
                "second path; else switch the units off and on"
            )
        case Autd3Error.NETWORK | Autd3Error.TIMEOUT:
            return "check power, cables and the name of the interface, and that no other program holds the units"
        case Autd3Error.UNSUPPORTED_FIRMWARE:
            return "use pyautd3 for firmware v10 to v12.1; update the 0 series to 0.12 with the manufacturer's console"
        case _:
            return "run midair doctor"
