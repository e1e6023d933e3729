"""Everything that a run of live touch is told."""

from dataclasses import dataclass, field

import numpy as np

from midair.devices import ExposureChoices, SilencerChoice
from midair.errors import InputError
from midair.model import Calibration, Placement, SensorWiring
from midair.rig.live_touch.live_loop import Pace
from midair.rig.live_touch.touch import TouchSettings

RATES = (100.0, 2000.0)
"""Frames per second between which live touch makes sense: below it is not felt as vibration, above a frame takes longer
than it lasts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkInput:
    """Frames that come over a network.

    Attributes
    ----------
    host, port : str, int
        Where to listen.
    key : bytes
        That both sides share.
    buffer : float
        Length of the jitter buffer, in s.
    """

    host: str
    port: int
    key: bytes = field(repr=False)
    buffer: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """What is felt where, and how it is played.

    Attributes
    ----------
    sensor : str
        By name, as in `midair.record`; what to call it where frames come over a network.
    device : str
        ``virtual``, or an AUTD3 array by name: ``autd3``, ``autd3:INTERFACE``, ``autd3:emulator``.
    exposure : ExposureChoices
        What the level has to keep.
    touch : TouchSettings
        From frame to phases.
    pace : Pace
        How long the loop waits for what.
    level : float
        Highest drive of any transducer, above 0 to 1.
    calibration : Calibration or None
        Of the sensor; its own if None.
    wiring : SensorWiring or None
        Which channel is which cell.
    placement : Placement or None
        Of the array's units; two by two if None.
    silencer : {"off", "quarter", "half", "default"}
        Over how long the firmware spreads steps.
    duration : float or None
        In s; until it is told to end if None.
    listen : Listening or None
        Where frames come from over a network, in place of a sensor here.
    priority : int
        Real-time priority of the loop, 1 to 99; 0 asks for none.
    seed : int
        Of a virtual sensor.
    """

    sensor: str
    device: str
    exposure: ExposureChoices
    touch: TouchSettings = field(default_factory=TouchSettings)
    pace: Pace = field(default_factory=Pace)
    level: float = 1.0
    calibration: Calibration | None = None
    wiring: SensorWiring | None = None
    placement: Placement | None = None
    silencer: SilencerChoice = "off"
    duration: float | None = None
    listen: "NetworkInput | None" = None
    priority: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.level <= 1:
            raise InputError(f"level: expected above 0 and at most 1 of full drive, got {self.level:g}")
        if not 0.002 <= self.pace.hold <= 0.02:
            raise InputError(
                f"hold: expected 2 to 20 ms, got {1e3 * self.pace.hold:g} ms; 6 ms leave time for what a frame takes "
                "on its way, and a unit queues 7 frames"
            )
        if self.duration is not None and not 0 < self.duration < np.inf:
            raise InputError(f"duration: expected above 0 s, got {self.duration:g} s")
        if self.sensor.startswith("audio:"):
            raise InputError(
                "live: expected a sensor that gives its frames at once, got a sound card, whose buffers take 64 ms; "
                "that is felt as delay. Use a converter over lsl:, serial: or ni:"
            )
