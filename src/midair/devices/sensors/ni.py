"""Converters of National Instruments; needs the extra `ni` and the vendor's driver NI-DAQmx.

The driver runs on Windows and some Linux distributions; this module has not been tested with real hardware.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import nidaqmx
import numpy as np
from nidaqmx.constants import AcquisitionType, TerminalConfiguration
from nidaqmx.errors import DaqNotFoundError
from nidaqmx.errors import Error as DaqmxError
from nidaqmx.system import System

from midair.devices.sensors.sources import Chunk, SensorOptions, Stream, above_zero, opened
from midair.errors import DeviceError

Wires = Literal["default", "rse", "nrse", "differential"]

_WIRES = {
    "default": TerminalConfiguration.DEFAULT,
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
    "differential": TerminalConfiguration.DIFF,
}


class NiSource:
    """Voltage inputs, sampled simultaneously.

    `channels` is in the driver's notation, such as ``Dev1/ai0:15``. `limit` is the range, plus and minus, in V. `wires`
    is the terminal configuration. `make_task` replaces the driver in tests.
    """

    def __init__(
        self,
        channels: str,
        *,
        rate: float = 1000.0,
        limit: float = 10.0,
        wires: Wires = "default",
        make_task: Callable[[], Any] = nidaqmx.Task,
    ) -> None:
        self._name, self._rate, self._limit, self._wires = channels, rate, limit, wires
        self._make = make_task
        self._task: Any = None
        self._frames = 0

    def open(self) -> Stream:
        """Reserve the inputs and configure range and clock."""
        try:
            self._task = self._make()
            self._task.ai_channels.add_ai_voltage_chan(
                self._name, terminal_config=_WIRES[self._wires], min_val=-self._limit, max_val=self._limit
            )
            self._task.timing.cfg_samp_clk_timing(
                # The driver buffers ten seconds of unread frames.
                self._rate,
                sample_mode=AcquisitionType.CONTINUOUS,
                samps_per_chan=max(1000, round(10 * self._rate)),
            )
            channels, rate = len(self._task.channel_names), float(self._task.timing.samp_clk_rate)
        except DaqNotFoundError as wrong:
            raise DeviceError(
                "ni: expected the driver NI-DAQmx, it is not installed; install it from the vendor (Debian has none)"
            ) from wrong
        except DaqmxError as wrong:
            raise self._failed(wrong) from wrong
        self._rate = rate
        return Stream(channels=channels, rate=rate, unit="V", full_scale=self._limit)

    def start(self) -> None:
        """Start sampling."""
        self._frames = 0
        try:
            opened(self._task, "ni").start()
        except DaqmxError as wrong:
            raise self._failed(wrong) from wrong

    def pull(self, wait: float) -> Chunk | None:
        """Return all frames in the driver's buffer."""
        task, end = opened(self._task, "ni"), time.monotonic() + wait
        try:
            while not (ready := int(task.in_stream.avail_samp_per_chan)):
                if time.monotonic() > end:
                    return None
                time.sleep(0.002)
            # Read only what is available, so that the read does not wait.
            samples = np.atleast_2d(np.asarray(task.read(ready, wait), np.float64)).T
        except DaqmxError as wrong:
            raise self._failed(wrong) from wrong
        first, self._frames = self._frames, self._frames + len(samples)
        return Chunk(
            samples=samples,
            first=first,
            device_time=first / self._rate,
            host_time=time.monotonic() - len(samples) / self._rate,
        )

    def stop(self) -> None:
        """Stop sampling."""
        if self._task is not None:
            self._quietly(self._task.stop)

    def close(self) -> None:
        """Release the inputs."""
        task, self._task = self._task, None
        if task is not None:
            self._quietly(task.close)

    def describe(self) -> dict[str, str]:
        """Inputs and their range."""
        return {"inputs": self._name, "range": f"{self._limit:g} V either way"}

    def _quietly(self, call: Callable[[], None]) -> None:
        """Ignore errors: after the loss of a device every call fails, and the first error was already raised."""
        try:
            call()
        except DaqmxError:
            return

    def _failed(self, wrong: Exception) -> DeviceError:
        lines = str(wrong).strip().splitlines() or [type(wrong).__name__]
        return DeviceError(f"ni: {self._name}: {lines[0]}; check the name in NI MAX, the cable, and the rate")


def devices() -> list[str]:
    """Names of the devices that the driver finds."""
    try:
        return [str(device.name) for device in System.local().devices]
    except DaqNotFoundError as wrong:
        raise DeviceError("ni: expected the driver NI-DAQmx, it is not installed; get it from the vendor") from wrong


@dataclass(frozen=True, kw_only=True)
class NiSensor(SensorOptions):
    """Kind ``ni:CHANNELS``; `wires` as in `NiSource`."""

    package = "nidaqmx"
    native: float | None = above_zero(None, "Rate of the converter; by default the frame rate.", "Hz")
    limit: float = above_zero(10.0, "Range, plus and minus.", "V")
    wires: Wires = "default"

    def source(self, place: str) -> NiSource:
        """Voltage inputs."""
        rate = self.native or self.rate or 1000.0
        return NiSource(place, rate=rate, limit=self.limit, wires=self.wires)

    @classmethod
    def available(cls) -> str:
        """Devices of the driver."""
        return f"devices: {', '.join(devices()) or 'none'}"
