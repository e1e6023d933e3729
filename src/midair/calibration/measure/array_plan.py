"""Phase codes that let a sensor measure each transducer of an array, played beside a steady focused beam.

A sensor measures radiation pressure, which grows with the square of the sound, so a single transducer is far too weak.
The square of a strong steady sound plus a weak changing one changes by 2 Re(conj(strong) weak), the product of both. So
all transducers hold a focus on some cells, and those of one group at a time are shifted by +90, -90 or 0 degrees by a
random code for each transducer. The component in phase with the beam gives the strength of a transducer, the component
in quadrature its phase error. Random codes of length L are orthogonal to 1 / sqrt(L). The transient after each step of
a code gives the resonance and the time constant.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.model import RATE, Acoustics, SensorGrid, TransducerArray
from midair.physics import quantise_phase, radiation_pressure, transfer_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayPlan:
    """Settings of the phase codes for an array, which are played group by group."""

    duration: float = 8.0
    """Duration of all codes together in s; the uncertainties fall with its square root."""
    group: int = 250
    """Approximate number of transducers per group."""
    top: float = 100.0
    """Highest pressure of the steady beam on any of its cells, in Pa."""
    settle: float = 0.15
    """Pause between two groups in s: twice the memory of a sensor that responds to changes only."""
    rate: float = RATE
    """Frame rate of the drive in Hz."""
    seed: int = 0
    """Random seed of groups and codes."""

    def __post_init__(self) -> None:
        for name, unit in (("duration", "s"), ("top", "Pa"), ("settle", "s"), ("rate", "Hz")):
            positive(getattr(self, name), f"{name} of the codes", unit)
        if self.group < 1:
            raise InputError(f"group of transducers: expected 1 or more, got {self.group}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCodes:
    """Phase codes of all groups, and the steady beam."""

    rate: float
    """Frame rate in Hz."""
    still: Array
    """Phases of the steady beam in rad, shape (transducer,)."""
    level: float
    """Drive level of all transducers, 0 to 1."""
    groups: tuple[NDArray[np.int64], ...]
    """Transducer numbers of each group."""
    codes: tuple[NDArray[np.int8], ...]
    """Quarter turns from the beam's phase (-1, 0, 1) per group, shape (frame, transducer of the group)."""
    settle: int
    """Frames between two groups and after the last; twice as many before the first."""
    cells: tuple[int, ...]
    """Channels under the beam."""

    @property
    def starts(self) -> tuple[int, ...]:
        """First coded frame of each group."""
        lengths = np.array([len(code) + self.settle for code in self.codes])
        return tuple(int(first) for first in 2 * self.settle + np.cumsum(lengths) - lengths)

    @property
    def frames(self) -> int:
        """Number of frames of all groups and pauses."""
        return 2 * self.settle + sum(len(code) + self.settle for code in self.codes)

    @property
    def phase(self) -> Array:
        """Phase of every frame in rad, shape (frame, transducer)."""
        phase = np.tile(self.still, (self.frames, 1))
        for first, group, code in zip(self.starts, self.groups, self.codes, strict=True):
            phase[first : first + len(code), group] += code * (np.pi / 2)
        return phase


def array_codes(
    array: TransducerArray, sensor: SensorGrid, plan: ArrayPlan, *, acoustics: Acoustics, height: float
) -> ArrayCodes:
    """Generate the codes of a plan for an array with a sensor over its centre.

    `array` is the nominal one, and the sensor lies at `height` in m above it. Raises InputError if there are fewer than
    twice as many measured numbers as unknowns in a group.
    """
    rng = np.random.default_rng(plan.seed)
    count = max(1, round(array.count / plan.group))
    groups = tuple(np.sort(part) for part in np.array_split(rng.permutation(array.count), count))
    frames = round(plan.duration * plan.rate / count)
    cells = middle_cells(sensor)
    # Each transducer has two unknowns of the response and two of the pole; each frame and cell gives one number.
    least = round(2 * 4 * len(groups[0]) / len(cells))
    if frames < least:
        raise InputError(
            f"duration of the codes: expected {least * count / plan.rate:.3g} s or more for {array.count} transducers, "
            f"got {plan.duration:g} s"
        )
    codes = tuple(rng.choice(np.array([-1, 0, 0, 1], np.int8), (frames, len(group))) for group in groups)
    still, level = _beam(array, sensor, cells, plan, acoustics, height)
    return ArrayCodes(
        rate=plan.rate,
        still=still,
        level=level,
        groups=groups,
        codes=codes,
        settle=round(plan.settle * plan.rate),
        cells=cells,
    )


def middle_cells(sensor: SensorGrid) -> tuple[int, ...]:
    """The channels in the middle of a sensor: one or two along each axis."""
    rows, columns = ({(count - 1) // 2, count // 2} for count in sensor.shape)
    return tuple(sorted(row * sensor.columns + column for row in rows for column in columns))


def _beam(
    array: TransducerArray,
    sensor: SensorGrid,
    cells: tuple[int, ...],
    plan: ArrayPlan,
    acoustics: Acoustics,
    height: float,
) -> tuple[Array, float]:
    """Phases with 8-bit steps for equal pressure on some cells, and the level for the plan's highest pressure."""
    foci = np.array([(*sensor.channel_position(cell), height) for cell in cells])
    G = transfer_matrix(foci, array, acoustics=acoustics)
    wanted = np.ones(len(cells), complex)
    q = np.exp(1j * np.angle(G.conj().T @ wanted))
    for _ in range(50):
        # Gerchberg-Saxton: equal amplitudes of the transducers, equal pressures on the cells.
        reached = G @ q
        wanted = np.abs(wanted) * np.abs(reached).mean() / np.abs(reached) * np.exp(1j * np.angle(reached))
        q = np.exp(1j * np.angle(G.conj().T @ wanted))
    phase = quantise_phase(np.angle(q))
    strongest = radiation_pressure(np.abs(G @ np.exp(1j * phase)), acoustics.medium).max()
    return phase, min(1.0, float(np.sqrt(plan.top / strongest)))
