"""What an array plays so that a sensor can tell its transducers apart: phase codes beside a beam that stands still.

A sensor feels radiation pressure, which goes with the square of the sound: of one transducer alone it feels nothing.
But in the square of a strong steady sound plus a weak one, what changes is 2 Re(conj(strong) weak): as loud as the weak
one times the strong one. So all transducers hold a focus on some cells, and those of one group at a time are put 90
degrees off it, forward, backward or not at all, by a random code of each one's own: in step with the beam the code
tells how strong a transducer is, across it how late. Random codes are orthogonal but for one over the root of their
length. What a transducer does between two steps of its code tells its resonance and its time constant.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, SensorGrid, TransducerArray
from midair.physics import quantise_phase, radiation_pressure, transfer_matrix
from midair.validation import positive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayPlan:
    """Codes for every transducer of an array, group by group.

    Attributes
    ----------
    duration : float
        Of all codes together, in s; the uncertainties fall with its root.
    group : int
        Transducers that are coded at a time, about.
    top : float
        Pressure that the still beam has on each cell that it is on at most, in Pa.
    settle : float
        Time between two groups in which nothing changes, in s: twice as long as a sensor that hears changes only
        remembers.
    rate : float
        Frames per second of the drive, in Hz.
    seed : int
        Of groups and codes.
    """

    duration: float = 8.0
    group: int = 250
    top: float = 100.0
    settle: float = 0.15
    rate: float = 1000.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, unit in (("duration", "s"), ("top", "Pa"), ("settle", "s"), ("rate", "Hz")):
            positive(getattr(self, name), f"{name} of the codes", unit)
        if self.group < 1:
            raise InputError(f"group of transducers: expected 1 or more, got {self.group}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCodes:
    """What is played.

    Attributes
    ----------
    rate : float
        Frames per second, in Hz.
    still : ndarray, shape (transducer,)
        Phases of the beam, in rad.
    level : float
        Of all transducers, 0 to 1 of full drive.
    groups : tuple of ndarray of int
        Numbers of the transducers of each group.
    codes : tuple of ndarray of int8, shape (frame, transducer of the group)
        Quarter turns off the beam: -1, 0, 1.
    settle : int
        Frames between two groups and after the last; twice as many before the first.
    cells : tuple of int
        Channels that the beam is on.
    """

    rate: float
    still: Array
    level: float
    groups: tuple[NDArray[np.int64], ...]
    codes: tuple[NDArray[np.int8], ...]
    settle: int
    cells: tuple[int, ...]

    @property
    def starts(self) -> tuple[int, ...]:
        """First coded frame of each group."""
        lengths = np.array([len(code) + self.settle for code in self.codes])
        return tuple(int(first) for first in 2 * self.settle + np.cumsum(lengths) - lengths)

    @property
    def frames(self) -> int:
        """Of all groups, and of the stillness around them."""
        return 2 * self.settle + sum(len(code) + self.settle for code in self.codes)

    @property
    def phase(self) -> Array:
        """Of each frame, shape (frame, transducer), in rad."""
        phase = np.tile(self.still, (self.frames, 1))
        for first, group, code in zip(self.starts, self.groups, self.codes, strict=True):
            phase[first : first + len(code), group] += code * (np.pi / 2)
        return phase


def array_codes(
    array: TransducerArray, sensor: SensorGrid, plan: ArrayPlan, *, acoustics: Acoustics, height: float
) -> ArrayCodes:
    """The codes of a plan for an array over whose centre a sensor lies.

    Parameters
    ----------
    array : TransducerArray
        As its model says it is.
    sensor : SensorGrid
        Lies over its centre.
    plan : ArrayPlan
        How long, how strong, how many at a time.
    acoustics : Acoustics
        Air and directivity.
    height : float
        Of the sensor above the array, in m.

    Raises
    ------
    InputError
        If the codes of a group would be shorter than twice what is asked of it.
    """
    rng = np.random.default_rng(plan.seed)
    count = max(1, round(array.count / plan.group))
    groups = tuple(np.sort(part) for part in np.array_split(rng.permutation(array.count), count))
    frames = round(plan.duration * plan.rate / count)
    cells = middle_cells(sensor)
    # Two unknowns of response and two of the pole, from as many numbers as there are frames and cells in the band.
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
    """Phases, in steps of 8 bits, that press alike on some cells, and the level that gives the pressure asked for."""
    foci = np.array([(*sensor.channel_position(cell), height) for cell in cells])
    G = transfer_matrix(foci, array, acoustics=acoustics)
    wanted = np.ones(len(cells), complex)
    q = np.exp(1j * np.angle(G.conj().T @ wanted))
    for _ in range(50):
        # Gerchberg and Saxton: equal amplitudes on one side, equal pressures on the other.
        reached = G @ q
        wanted = np.abs(wanted) * np.abs(reached).mean() / np.abs(reached) * np.exp(1j * np.angle(reached))
        q = np.exp(1j * np.angle(G.conj().T @ wanted))
    phase = quantise_phase(np.angle(q))
    strongest = radiation_pressure(np.abs(G @ np.exp(1j * phase)), acoustics.medium).max()
    return phase, min(1.0, float(np.sqrt(plan.top / strongest)))
