"""Settings of live touch: the source of the keywords of `live`, the options of the command and the studio's form."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.devices import ExposureChoices
from midair.errors import InputError
from midair.files import load_calibration, load_placement, load_sensor
from midair.model import BAND, HEIGHT, HEIGHTS, Acoustics, Calibration, ControlGrid, Medium, Placement, SensorWiring
from midair.rig.playing import default_exposure
from midair.validation import Declared, check_settings, documented, setting

USUAL = 0.006
"""Default delay of the inverse filter, in s."""
LONGEST = 0.1
"""Longest delay of the inverse filter, in s; the zero-phase inverse from 20 Hz on needs no more."""
WINDOW = 0.02
"""Time from sampling to emitting a frame with a latency, in s; computing may vary by it."""
RISE = 0.4e-3
"""Rise time of the transducers in s."""
MOST, FASTEST = 4, 4000.0
"""Most frames of the array for one of the sensor, and its highest frame rate in Hz."""

LiveMapping = Literal["half-wave", "constant-offset", "slow-bias"]
"""Mappings that live touch supports."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings(Declared):
    """Settings of a run of live touch, in SI units.

    Raises
    ------
    InputError
        If a value is out of range or does not fit another.
    """

    sensor: str = setting(
        "virtual:towel",
        "Sensor: lsl:NAME, serial:PORT, ni:CHANNELS; or virtual:towel (brush, sponge ...), replay:FILE, which repeat.",
    )
    device: str = setting(
        "virtual",
        "Array: virtual, autd3, autd3:INTERFACE or autd3:emulator.",
        stored="device",
    )
    calibration: Calibration | None = setting(
        None, "Calibration of the sensor, a file of midair calibrate.", load=load_calibration
    )
    wiring: SensorWiring | None = setting(
        None, "TOML file of the sensor with the order of its channels.", load=load_sensor, option="sensor-file"
    )
    height: float = setting(HEIGHT, "Height of the palm above the array.", unit="m", limits=HEIGHTS, stored="height_m")
    gain: float = setting(1.0, "Factor on the pressure.", limits=(0, 100), above=True, stored="gain")
    level: float = setting(
        1.0,
        "Highest drive level of any transducer, 0 to 1; the exposure check assumes the worst case at this level.",
        limits=(0, 1),
        above=True,
    )
    # 6 ms suffice for computing and sending a frame; a unit queues 7 frames.
    hold: float = setting(
        0.006,
        "Delay from sampling a frame to emitting it; all computing and sending must fit into it.",
        unit="s",
        limits=(0.002, 0.02),
        stored="hold_s",
    )
    delay: float = setting(
        USUAL,
        "Delay of the inverse sensor filter, 2 to 10 ms; shorter is less accurate.",
        unit="s",
        limits=(0.002, 0.01),
        stored="filter_delay_s",
    )
    latency: float | None = setting(
        None,
        "Total delay from skin to skin, from 130 ms on, for a slow bias and a more accurate filter. [default: 13 ms]",
        unit="s",
        limits=(0.13, 1.0),
        stored="latency_s",
    )
    rate: float | None = setting(
        None,
        "Frames per second of the array with --latency, such as 2kHz or 4kHz. [default: the sensor's]",
        unit="Hz",
        stored="rate_hz",
    )
    mapping: LiveMapping = setting(
        "half-wave",
        "How signed pressure is made positive: half-wave; constant-offset (needs --offset); "
        "slow-bias (90 ms more delay).",
        stored="mapping",
    )
    offset: float | None = setting(None, "Offset of the mapping constant-offset.", unit="Pa", stored="offset_pa")
    faintest: float = setting(
        0.1,
        "Pressure on the strongest cell below which a frame is silent: the sensor's noise is not played.",
        unit="Pa",
        limits=(0, np.inf),
        option="",
    )
    band: tuple[float, float] = setting(BAND, "Lowest and highest frequency to reproduce.", unit="Hz", stored="band_hz")
    silencer: Literal["off", "quarter", "half", "default"] = setting("off", "How the units smooth phase steps.")
    placement: Placement | None = setting(
        None,
        "TOML file with position and rotation of the units. [default: two by two, side by side]",
        load=load_placement,
    )
    acoustics: Acoustics = setting(
        lambda: Acoustics(medium=Medium.at()), "Air of the room and directivity of the transducers.", option=""
    )
    exposure: ExposureChoices = setting(default_exposure, "Exposure limits.", option="")
    cooling_limit: float | None = setting(
        None, "Longest pause in silence while units are too hot; None ends the run at once.", unit="s", option=""
    )
    priority: int = setting(
        20, "Real-time priority of the process to request, 1 to 99; 0 requests none.", limits=(0, 99)
    )
    participant: str = setting("", "Code of the person at the array, for midair log export.")
    seed: int = setting(0, "Random seed of a virtual sensor.")
    listen: str | None = setting(
        None,
        "Receive frames on HOST:PORT instead of reading a sensor, such as 0.0.0.0:5005. Needs --key.",
    )
    key: Path | None = setting(
        None, "Key file that both computers share; packets that fail authentication are dropped.", load=Path
    )
    buffer: float = setting(0.01, "Jitter buffer of the receiver; it adds to the delay.", unit="s", limits=(0, 0.2))
    duration: float | None = setting(
        None, "Time to play. [default: until Ctrl-C]", unit="s", limits=(0, np.inf), above=True
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if self.latency is None and self.rate is not None:
            raise InputError(f"rate: expected --latency with it, got {self.rate:g} Hz alone: frames play as they come")
        if self.latency is not None and self.listen is not None:
            raise InputError("--latency: expected a sensor on this computer, got --listen; leave one of them out")
        if self.latency is not None and self.offset is None:
            object.__setattr__(self, "mapping", "slow-bias")
        if (self.mapping == "constant-offset") != (self.offset is not None):
            raise InputError(
                "offset: expected a value in Pa for constant-offset and none for other mappings, got "
                f"{'none' if self.offset is None else 'one'} for {self.mapping}; measure it on an earlier recording"
            )
        if self.sensor.startswith("audio:"):
            raise InputError(
                "live: expected a sensor without long buffers, got a sound card, whose buffers delay by 64 ms; "
                "use a converter over lsl:, serial: or ni:"
            )
        if self.listen is not None:
            if self.key is None:
                raise InputError(
                    "--listen: expected --key with the key file that both sides share, got none; make one with "
                    "--new-key FILE"
                )
            host_and_port(self.listen, "--listen")

    @property
    def source(self) -> str:
        """Name of the sensor, or of the network address at which frames are received."""
        return self.sensor if self.listen is None else f"listen:{self.listen}"

    @property
    def grid(self) -> ControlGrid:
        """Control points on the palm."""
        return ControlGrid(height=self.height)

    def frames_each(self, rate: float) -> int:
        """Frames of the array for each of a sensor at `rate` in Hz; InputError if it is no whole number up to 4."""
        wanted = 1.0 if self.latency is None else (self.rate or rate) / rate
        each = max(1, round(wanted))
        if each > MOST or abs(each - wanted) > 1e-6 * each or each * rate > FASTEST:
            raise InputError(
                f"--rate: expected 1 to {MOST} times the sensor's {rate:g} Hz and at most {FASTEST:g} Hz, got "
                f"{wanted * rate:g} Hz"
            )
        return each

    def timing(self, mapped: float, interpolated: float) -> tuple[float, float]:
        """Delay of the inverse filter, and the time from sampling to emitting a frame, in s.

        `mapped` and `interpolated` are the delays of the mapping and of the interpolation. With a latency the filter
        gets what is left of it, up to `LONGEST`, unless a delay is given; the rest is time for computing.
        """
        if self.latency is None:
            return self.delay, self.hold
        fixed = mapped + interpolated + RISE + self.height / self.acoustics.medium.speed
        left = self.latency - fixed - WINDOW
        delay = self.delay if self.delay != USUAL else min(left, LONGEST)
        if delay < 0.002 or self.latency - fixed - delay < 0.002:
            least = 1e3 * (fixed + WINDOW + 0.002)
            raise InputError(f"--latency: expected at least {least:.0f} ms here, got {1e3 * self.latency:g} ms")
        return delay, self.latency - fixed - delay

    def stored(self) -> dict[str, Any]:
        """Return the settings that the provenance of a take states."""
        medium = self.acoustics.medium
        air = {"sound_m_s": medium.speed, "temperature_c": medium.temperature, "humidity": medium.humidity}
        kept = {one.metadata["stored"]: getattr(self, one.name) for one in fields(self) if "stored" in one.metadata}
        return {**kept, **air, "air_stated": self.exposure.room is not None}


def host_and_port(text: str, option: str) -> tuple[str, int]:
    """Split an address such as ``lab.example:5005`` or ``[::1]:5005``; InputError if it is invalid."""
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) < 65536):
        raise InputError(f"{option}: expected HOST:PORT, such as 192.168.1.20:5005, got {text!r}")
    return host.removeprefix("[").removesuffix("]"), int(port)
