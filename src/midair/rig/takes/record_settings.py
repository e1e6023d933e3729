"""Settings of recording: source of the keywords of `record`, the options of the command and the studio's form."""

from dataclasses import dataclass

import numpy as np

from midair.files import load_sensor
from midair.model import SensorWiring
from midair.validation import Declared, check_settings, documented, setting


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings(Declared):
    """Settings of one take of a sensor or of several, in SI units; InputError if a value is out of range."""

    sensor: str = setting("virtual:towel", "Sensor, as in midair record.", option="")
    duration: float | None = setting(None, "Length of a take.", unit="s", limits=(0, np.inf), above=True)
    level: float | None = setting(
        None,
        "Start when any channel differs from its resting value by this much, such as 50mV or 300count.",
        limits=(0, np.inf),
        above=True,
        option="trigger",
        # Read once the sensor, and so its unit, is known.
        typed=str | None,
    )
    pre_roll: float = setting(0.2, "Time to keep before the start, with --trigger or a key.", unit="s", limits=(0, 60))
    post_roll: float | None = setting(
        0.5,
        "With --trigger: end the take when the signal stays below the trigger level for this long.",
        unit="s",
        limits=(0, np.inf),
        above=True,
    )
    repeats: int = setting(
        1, "Number of takes; the paper made five strokes per object and surface.", limits=(1, np.inf)
    )
    pause: float | None = setting(None, "Pause between takes that start automatically.", unit="s", limits=(0, np.inf))
    wiring: SensorWiring | None = setting(
        None,
        "Sensor file NAME.toml: the cell of each channel, unit and full scale.",
        load=load_sensor,
        option="sensor-file",
    )
    real_time: bool = setting(False, "Let a virtual or replayed sensor run in real time.")
    seed: int = setting(0, "Random seed of a virtual sensor: noise and texture.")

    def __post_init__(self) -> None:
        check_settings(self)
