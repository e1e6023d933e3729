"""Settings of live touch: the source of the keywords of `live`, the options of the command and the studio's form."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from midair.errors import InputError
from midair.files import load_sensor
from midair.model import BAND, HEIGHT, HEIGHTS, RATE, Acoustics, ControlGrid, Medium, SensorWiring
from midair.rig.playing.play_settings import RigSettings
from midair.targets import MappingStream
from midair.validation import documented, setting

LiveMapping = Literal["half-wave", "constant-offset", "slow-bias"]
"""Mappings that live touch supports."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings(RigSettings):
    """Settings of a run of live touch, in SI units.

    Raises InputError if a value is out of range or does not fit another.
    """

    sensor: str = setting(
        "virtual:towel",
        "Sensor: lsl:NAME, serial:PORT, ni:CHANNELS; or virtual:towel (brush, sponge ...), replay:FILE, which repeat.",
    )
    wiring: SensorWiring | None = setting(
        None, "TOML file of the sensor with the order of its channels.", load=load_sensor, option="sensor-file"
    )
    height: float = setting(HEIGHT, "Height of the palm above the array.", unit="m", limits=HEIGHTS)
    gain: float = setting(1.0, "Factor on the pressure.", limits=(0, 100), above=True)
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
    )
    delay: float = setting(
        0.006,
        "Delay of the inverse sensor filter, 2 to 10 ms; shorter is less accurate.",
        unit="s",
        limits=(0.002, 0.01),
    )
    latency: float | None = setting(
        None,
        "Total latency for better quality, 120 to 300 ms: 2000 frames a second with slow bias, compensated for the "
        "transducers; it replaces --delay, --hold and --mapping. [default: 13 ms, as these set it]",
        unit="s",
        limits=(0.12, 0.3),
    )
    mapping: LiveMapping = setting(
        "half-wave",
        "How signed pressure is made positive: half-wave; constant-offset (needs --offset); "
        "slow-bias (90 ms more delay).",
    )
    offset: float | None = setting(None, "Offset of the mapping constant-offset.", unit="Pa")
    faintest: float = setting(
        0.1,
        "Pressure on the strongest cell below which a frame is silent: the sensor's noise is not played.",
        unit="Pa",
        limits=(0, np.inf),
        option="",
    )
    band: tuple[float, float] = setting(BAND, "Lowest and highest frequency to reproduce.", unit="Hz")
    acoustics: Acoustics = setting(
        lambda: Acoustics(medium=Medium.at()), "Air of the room and directivity of the transducers.", option=""
    )
    cooling_limit: float | None = setting(
        None, "Longest pause in silence while units are too hot; None ends the run at once.", unit="s", option=""
    )
    priority: int = setting(
        20, "Real-time priority of the process to request, 1 to 99; 0 requests none.", limits=(0, 99)
    )
    duration: float | None = setting(
        None, "Time to play. [default: until Ctrl-C]", unit="s", limits=(0, np.inf), above=True
    )

    def __post_init__(self) -> None:
        RigSettings.__post_init__(self)
        if (self.mapping == "constant-offset") != (self.offset is not None):
            raise InputError(
                "offset: expected a value in Pa for constant-offset and none for other mappings, got "
                f"{'none' if self.offset is None else 'one'} for {self.mapping}; measure it on an earlier recording"
            )
        if self.latency is not None:
            if self.offset is not None:
                raise InputError("latency: expected no --offset, got one; leave it out")
            self.schedule(RATE)
        if self.sensor.startswith("audio:"):
            raise InputError(
                "live: expected a sensor without long buffers, got a sound card, whose buffers delay by 64 ms; "
                "use a converter over lsl:, serial: or ni:"
            )

    def schedule(self, rate: float) -> "LiveSchedule":
        """Share out the latency for a sensor of a rate in Hz; InputError if it is too short for the band."""
        if self.latency is None:
            return LiveSchedule(delay=self.delay, hold=self.hold, ahead=self.hold, mapping=self.mapping, formed=1)
        formed, hold = max(1, int(FINE / rate)), 0.02
        bias = MappingStream("slow-bias", formed * rate, band=self.band).delay / (formed * rate)
        rest = self.latency - hold - bias - RISE - self.height / self.acoustics.medium.speed
        if rest < 0.005:
            least = f"{1e3 * (self.latency - rest) + 5:.0f} ms for a band from {self.band[0]:g} Hz"
            raise InputError(f"latency: expected at least {least}, got {1e3 * self.latency:g} ms; give a longer one")
        # A unit queues 7 frames.
        ahead = min(hold, 6 / (formed * rate))
        return LiveSchedule(delay=rest, hold=hold, ahead=ahead, mapping="slow-bias", formed=formed)

    @property
    def grid(self) -> ControlGrid:
        """Control points on the palm."""
        return ControlGrid(height=self.height)


FINE = 2000.0
"""Frames a second of the array where a latency is given, in Hz; at 4 kHz a frame lasts shorter than its solution."""

RISE = 0.4e-3
"""Rise time of the transducers in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSchedule:
    """Times of live touch in s, and the mapping that they allow."""

    delay: float
    """Delay of the filter that inverts the sensor."""
    hold: float
    """Delay from sampling a frame to emitting it, without filter and mapping."""
    ahead: float
    """Longest time by which a frame is sent ahead of its instant."""
    mapping: LiveMapping
    formed: int
    """Frames of the array for each frame of the sensor."""
    enough: float = 0.0015
    """Time that a frame needs for computing and sending; a frame with less time left is skipped."""
    quiet: float = 0.02
    """Time without a frame after which the level fades."""
    fade: float = 0.005
    """Duration of the fade."""
    rise: float = 1.0
    """Duration of the rise of the level, at the beginning and after missing frames."""
    word: float = 0.01
    """Interval of silent frames while nothing else is sent; far below the units' failsafe."""
    trips: int = 5
    """Number of times that the units' failsafe may act within ten seconds; after one more the run ends."""
