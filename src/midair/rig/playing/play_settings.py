"""Settings of playing: source of the keywords of `play` and `open_rig`, of options and of the studio's form."""

from dataclasses import dataclass
from typing import Literal

from midair.devices import Cooling, ExposureChoices, SilencerChoice
from midair.errors import InputError
from midair.files import DEFAULT_PROFILE, load_calibration, load_palm_path, load_placement, profile_named
from midair.model import (
    BAND,
    HEIGHT,
    HEIGHTS,
    Acoustics,
    ArrayCalibration,
    Calibration,
    PalmPath,
    Placement,
    SensorGrid,
)
from midair.rig.names.array_names import array_calibration_named
from midair.rig.names.sensor_names import tracker_options
from midair.settings import TransducerSpread
from midair.validation import Declared, check_settings, documented, setting


def default_exposure() -> ExposureChoices:
    """Default exposure limits: the default profile without override."""
    return ExposureChoices(profile=profile_named(DEFAULT_PROFILE))


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class RigSettings(Declared):
    """Settings of an array and its sensor that playing and live touch share.

    InputError if a value is out of range; UnknownDeviceError if no tracker has the name in `follow`.
    """

    device: str = setting(
        "virtual",
        "virtual: simulated array and sensor.\n"
        "autd3, autd3:INTERFACE: units over Ethernet. autd3:emulator: their emulator.\n"
        "autd3-simulator, autd3-server: the makers' programs on this computer.\n"
        "pyautd3, pyautd3:INTERFACE: older units over EtherCAT. pyautd3:audit, pyautd3:nop: no units.\n",
    )
    calibration: Calibration | None = setting(
        None, "Calibration of that sensor, a file of midair calibrate.", load=load_calibration
    )
    array_calibration: ArrayCalibration | Literal["none"] | None = setting(
        None,
        "Measured transducers, NAME.array.h5 of midair calibrate array: those of the virtual device; for a real one "
        "those to solve for, by default its stored calibration; none: the model's.",
        load=array_calibration_named,
    )
    placement: Placement | None = setting(
        None,
        "TOML file with position and rotation of the units. [default: two by two, side by side]",
        load=load_placement,
    )
    silencer: SilencerChoice = setting(
        "off", "How the array smooths phase steps: over a quarter or half of a frame; default: the firmware's 1 ms."
    )
    exposure: ExposureChoices = setting(default_exposure, "Exposure limits of every drive.", playback=True, option="")
    participant: str = setting(
        "",
        "Code of the person at the array for log and hours of a day, not a name. The virtual device logs nothing.",
        playback=True,
    )
    follow: str | None = setting(
        None,
        "Tracker of the palm that every frame is steered to, such as replay:hand.csv.\n"
        "Sound fades while the palm is outside 100 x 100 x 60 mm or tilted by more than 15 degrees, or not tracked.",
        playback=True,
    )
    tracker_latency: float | None = setting(
        None, "Latency of the tracker, from a pose to its arrival.", unit="s", limits=(0, 1), playback=True
    )
    confidence: float = setting(
        0.3, "Confidence of the tracker below which the sound fades, 0 to 1.", limits=(0, 1), playback=True
    )
    seed: int = setting(0, "Random seed of the virtual rig: transducer strengths and noise.")

    def __post_init__(self) -> None:
        check_settings(self)
        if self.follow is not None:
            tracker_options(self.follow)
        elif self.tracker_latency is not None or self.confidence != 0.3:
            raise InputError("--tracker-latency, --confidence: expected --follow with them, got none")


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class PlaySettings(RigSettings):
    """Settings of an array, its sensor and a playback, in SI units; InputError if a value is out of range."""

    sensor: str | None = setting(
        None, "Sensor that re-records a real array: lsl:NAME, audio:DEVICE, serial:PORT, ni:CHANNELS."
    )
    repeats: int = setting(1, "Number of times to play the drive, without gaps.", limits=(1, 100_000), playback=True)
    delay: float = setting(0.0, "Time before the first frame.", unit="s", limits=(0, 3600), playback=True)
    cooling: Cooling | None = setting(
        None, "How to wait for units that are too hot; None ends playback.", playback=True
    )
    steer_only: bool = setting(
        False, "Do not fit followed frames to the tilt, the turn and the distance of the palm.", playback=True
    )
    palm_path: PalmPath | None = setting(
        None,
        "CSV file of poses along which the palm of the virtual device moves, from the first frame on.",
        load=load_palm_path,
    )
    height: float = setting(HEIGHT, "Height of a virtual sensor above the array.", unit="m", limits=HEIGHTS)
    cells: SensorGrid = setting(SensorGrid, "Cells of a virtual sensor.")
    band: tuple[float, float] = setting(BAND, "Frequencies that a virtual sensor must record.", unit="Hz")
    acoustics: Acoustics | None = setting(
        None, "Air and directivity of the virtual rig; the air of each drive if None."
    )
    spread: TransducerSpread = setting(
        "default",
        "Differences between the virtual transducers: default, boards (phases as measured on published boards) or "
        "data-sheets (limits of data sheets).",
    )
