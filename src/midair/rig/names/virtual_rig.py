"""A simulated rig: array, sensor, and the air between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, TypedDict

from midair.datasets import am_stimulus, stroke, taps
from midair.devices import VirtualArray, VirtualSensor, VirtualSkin
from midair.errors import BandError, UnknownDeviceError
from midair.model import HEIGHT, HEIGHTS, RATE, Acoustics, PalmPath, PressureFrames, SensorGrid, TransducerArray
from midair.physics import SensorModel, TransducerDynamics, Transducers
from midair.validation import length

TransducerSpread = Literal["default", "boards", "data-sheets"]
"""Differences between the transducers of a virtual array, see docs/fidelity.md."""


class _Spread(TypedDict, total=False):
    spread: float
    resonance_spread: float


SPREADS: Mapping[TransducerSpread, _Spread] = MappingProxyType(
    {
        # Assumed: 5 % of strength, 50 Hz, 5 % of quality; phases then differ by 0.06 rad.
        "default": {},
        # Phases differ by 0.2 rad, the median over 33 boards of OpenMPD whose files state a measured phase for each of
        # 256 transducers (RMResearch/OpenMPD, OpenMPD_Client/board_*.pat), without a quadratic trend over the board.
        "boards": {"resonance_spread": 180.0},
        # 40.0 +- 1.0 kHz (Pro-Wave 400PT120, Changzhou FHD), taken as three standard deviations; strength assumed.
        "data-sheets": {"resonance_spread": 1000.0 / 3, "spread": 0.1},
    }
)
"""Arguments of `VirtualArray` for each spread; its defaults otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRig:
    """Parameters of a simulated rig; the sensor lies face down over the centre of the array."""

    array: TransducerArray = field(default_factory=TransducerArray.autd3)
    cells: SensorGrid = field(default_factory=SensorGrid)
    height: float = HEIGHT
    """Height of the sensor above the array in m."""
    acoustics: Acoustics | None = None
    """Air during playback, whatever a drive was solved for, and directivity; each drive's own air if None."""
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    rate: float = RATE
    """Rate of the sensor in Hz."""
    steps: int = 8
    """Simulation steps per frame of the sensor."""
    seed: int = 0
    """Seed of the sensor's spread and noise and of the transducers' strengths."""
    spread: TransducerSpread = "default"
    """Differences between the transducers."""
    transducers: Transducers | None = None
    """Transducers of the array, such as from `Transducers.measured`; a random spread if None."""
    palm: PalmPath | None = None
    """Poses of the sensor during each play, in array coordinates; it rests over the centre of the array if None."""
    peak: float = 30.0
    """Peak pressure of a modulated focus in Pa; at 30 Pa two corrected foci stay within the array's power."""

    def __post_init__(self) -> None:
        length(self.height, "height", HEIGHTS)

    @property
    def sensor_model(self) -> SensorModel:
        """The sensor, with a random spread of its channels."""
        cells = replace(self.cells, name=f"virtual sensor {self.seed}")
        return SensorModel.usual(cells).with_spread(seed=self.seed)

    def hearing(self, band: tuple[float, float]) -> "VirtualRig":
        """Return the rig with a sensor rate high enough for a band: at 1 kHz up to 487 Hz, at 8 kHz up to 3.9 kHz.

        BandError if the band exceeds that.
        """
        for rate in (1e3, 2e3, 4e3, 8e3):
            if 2.05 * band[1] <= rate:
                chosen = max(rate, self.rate)
                return replace(self, rate=chosen, steps=max(2, round(self.rate * self.steps / chosen)))
        raise BandError(
            f"band: expected one up to 3900 Hz, the limit of the virtual sensor, got {band[0]:g} to {band[1]:g} Hz"
        )

    def skin(self) -> VirtualSkin:
        """Surface that carries the sensor."""
        return VirtualSkin(self.sensor_model, height=self.height, rate=self.rate * self.steps)

    def sensor(self, skin: VirtualSkin, *, touch: PressureFrames | None = None, name: str = "virtual") -> VirtualSensor:
        """Make the sensor on its surface, touched from the start if `touch` is given."""
        return VirtualSensor(skin, touch=touch, rate=self.rate, seed=self.seed, name=name)

    def array_device(self, skin: VirtualSkin | None = None) -> VirtualArray:
        """Make the array, whose sound presses on the surface."""
        return VirtualArray(
            self.array,
            skin,
            acoustics=self.acoustics,
            dynamics=self.dynamics,
            seed=self.seed,
            transducers=self.transducers,
            palm=self.palm,
            **SPREADS[self.spread],
        )

    def touched_by(self, thing: str, *, duration: float | None = None) -> VirtualSensor:
        """Make the sensor with a simulated touch from the start, for some seconds.

        ``brush``, ``sponge`` or ``towel``, each with ``+groove`` for the grooved surface; ``am-i``, ``am-ii`` or
        ``am-iii``; or ``taps``, on each cell in turn; UnknownDeviceError for other names. Without a duration a whole
        stroke, or half a second of a modulated focus.
        """
        skin = self.skin()
        touch = self._touch(thing, skin, duration)
        return self.sensor(skin, touch=touch, name=f"virtual:{thing}")

    def _touch(self, thing: str, skin: VirtualSkin, duration: float | None) -> PressureFrames:
        grid = skin.model.grid
        match thing.partition("+"):
            case ("brush" | "sponge" | "towel" as name, _, "" | "groove" as surface):
                # Only silence follows, which the skin appends.
                longest = None if duration is None else min(duration, 10.0)
                return stroke(name, groove=bool(surface), seed=self.seed, rate=skin.rate, duration=longest, sensor=grid)
            case ("am-i" | "am-ii" | "am-iii" as name, "", ""):
                number: Literal["i", "ii", "iii"] = "i" if name == "am-i" else "ii" if name == "am-ii" else "iii"
                return am_stimulus(number, peak=self.peak, duration=duration or 0.5, rate=skin.rate, sensor=grid)
            case ("taps", "", ""):
                return taps(seed=self.seed, rate=skin.rate, sensor=grid)
            case _:
                raise UnknownDeviceError(
                    "virtual sensor: expected brush, sponge or towel (+groove or not), am-i, am-ii, am-iii or taps, "
                    f"got {thing!r}"
                )
