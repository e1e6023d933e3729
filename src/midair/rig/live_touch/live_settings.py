"""Settings of a run of live touch."""

from dataclasses import dataclass, field

import numpy as np

from midair.devices import ExposureChoices, SilencerChoice
from midair.errors import InputError
from midair.model import Calibration, Placement, SensorWiring
from midair.rig.live_touch.live_loop import Pace
from midair.rig.live_touch.touch import TouchSettings

RATES = (100.0, 2000.0)
"""Frame rates in Hz for live touch: below, no vibration is felt; above, a frame takes longer to compute than it lasts.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkInput:
    """Frames received over a network."""

    host: str
    """Address to listen at."""
    port: int
    key: bytes = field(repr=False)
    """Key that both sides share."""
    buffer: float = 0.01
    """Length of the jitter buffer in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """Settings of a run of live touch."""

    sensor: str
    """Sensor name, as in `midair.record`; a label if frames arrive over a network."""
    device: str
    """``virtual``, or an AUTD3 array: ``autd3``, ``autd3:INTERFACE``, ``autd3:emulator``."""
    exposure: ExposureChoices
    """Exposure limits of the level."""
    touch: TouchSettings = field(default_factory=TouchSettings)
    """Processing from frame to phases."""
    pace: Pace = field(default_factory=Pace)
    """Time limits of the loop."""
    level: float = 1.0
    """Largest drive of any transducer, above 0 to 1."""
    calibration: Calibration | None = None
    """Calibration of the sensor; its own if None."""
    wiring: SensorWiring | None = None
    """Assignment of channels to cells."""
    placement: Placement | None = None
    """Placement of the array's units; two by two if None."""
    silencer: SilencerChoice = "off"
    """How the firmware spreads phase steps: "off", "quarter", "half" or "default"."""
    duration: float | None = None
    """Duration in s; until it is ended if None."""
    listen: "NetworkInput | None" = None
    """Network input, which replaces a local sensor."""
    priority: int = 20
    """Real-time priority of the loop, 1 to 99; 0 for none."""
    seed: int = 0
    """Seed of a virtual sensor."""

    def __post_init__(self) -> None:
        if not 0 < self.level <= 1:
            raise InputError(f"level: expected above 0 and at most 1 of full drive, got {self.level:g}")
        if not 0.002 <= self.pace.hold <= 0.02:
            raise InputError(
                f"hold: expected 2 to 20 ms, got {1e3 * self.pace.hold:g} ms; 6 ms suffice for computing and sending "
                "a frame, and a unit queues 7 frames"
            )
        if self.duration is not None and not 0 < self.duration < np.inf:
            raise InputError(f"duration: expected above 0 s, got {self.duration:g} s")
        if self.sensor.startswith("audio:"):
            raise InputError(
                "live: expected a sensor without long buffers, got a sound card, whose buffers delay by 64 ms; "
                "use a converter over lsl:, serial: or ni:"
            )
