"""A drive in the laboratory: palm, air, units, transducers and echo differ from what it was solved for."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.evaluate import ALL, ALL_FOLLOWED, ALL_MEASURED, LaboratoryLoss, Place, fidelity
from midair.files import Laboratory
from midair.model import (
    Acoustics,
    ArrayCalibration,
    ControlGrid,
    Drive,
    PalmPath,
    PressureFrames,
    Progress,
    TransducerArray,
)
from midair.physics import (
    PlaybackChain,
    SensorModel,
    Spread,
    Transducers,
    TransducerState,
    Waves,
    array_from_palm,
    cell_weights,
    middle_of,
    palm_matrix,
    radiate,
    wavenumber,
)
from midair.rig.correction.correction_loop import Loop
from midair.rig.names.sensor_names import VirtualRig
from midair.settings import Settings

LONGEST = 0.1
"""Duration of the compared part in s, from the middle of a longer one."""

STEPS = 2
"""Moments per frame at which the pressure is computed."""

AS_MEASURED = (0.0133, 0.0151)
"""Relative strength and phase in rad that `midair calibrate array` leaves unknown (`benchmarks.unknown_arrays`)."""

FOLLOWED = {"palm_aside_mm": 2.5, "palm_height_mm": 2.5, "palm_tilt_deg": 3.1, "palm_turn_deg": 2.2}
"""Standard uncertainties of a palm whose tracker was placed where foci are felt, within 5 mm each (assumed)."""

PARTS: dict[str, tuple[str, ...]] = {
    "palm sideways": ("palm_aside_mm",),
    "palm height": ("palm_height_mm",),
    "palm tilt": ("palm_tilt_deg",),
    "palm rotation": ("palm_turn_deg",),
    "temperature": ("temperature_k",),
    "units": ("unit_position_mm", "unit_angle_deg"),
    "transducers": ("strength", "resonance_hz"),
    "dead transducers": ("dead",),
    "frequency": ("frequency",),
    "echo": ("reflection",),
}
"""Each uncertainty with its fields in `Laboratory`."""


def laboratory_loss(
    asked: PressureFrames,
    drive: Drive,
    laboratory: Laboratory,
    *,
    sensor: SensorModel,
    grid: ControlGrid,
    judged: tuple[float, float],
    band: tuple[float, float],
    measured: ArrayCalibration | None = None,
    seed: int = 0,
    draws: tuple[int, int] = (12, 48),
    fixed_place: bool = False,
    progress: Progress | None = None,
) -> LaboratoryLoss:
    """Play a drive in random laboratories, and compare with the pressure that was asked for.

    Frames are held and transducers follow them, as a solve compensates; phases and sensor are ideal. `asked` is the
    target pressure on the cells, from the drive's first frame, `grid` the control points of the solve. `judged` is
    (start, duration) of the compared part in s; at most `LONGEST` of it is compared. Of `measured` transducers, for
    which the drive was solved, only the uncertainty remains; if they are not measured, all together is also computed as
    if they were. `draws` counts the laboratories for each uncertainty alone and for all together. A shift and a turn of
    the palm in its plane are no distortion, unless `fixed_place`.
    """
    asked, drive, judged = _part(asked, drive, judged)
    stage = _Stage.of(drive, sensor, grid, measured)
    aside, turn = 1e-3 * laboratory.palm_aside_mm, float(np.radians(laboratory.palm_turn_deg))
    if not fixed_place:
        laboratory = laboratory.but(palm_aside_mm=0.0, palm_turn_deg=0.0)

    def ratio(stage: _Stage, own: Laboratory, *draw: int) -> float:
        # A stream for each draw: other uncertainties, or a measured array, do not change the palm's.
        rng = np.random.default_rng([seed, *draw])
        cells = stage.pressure(own, rng).reshape(-1, *asked.sensor.shape)
        came = replace(asked, pressure=cells, rate=STEPS * drive.rate)
        return fidelity(asked, came, band=band, judged=judged).overall_ratio

    nothing = Laboratory(**dict.fromkeys((name for names in PARTS.values() for name in names), 0.0))
    kept = {name: {each: getattr(laboratory, each) for each in names} for name, names in PARTS.items()}
    plan = [(name, stage, nothing.but(**own), draws[0]) for name, own in kept.items() if any(own.values())]
    plan = [*plan, (ALL, stage, laboratory, draws[1])]
    if measured is None:
        plan.append((ALL_MEASURED, replace(stage, supposed=True), laboratory, draws[1]))
    if moves := {name: value for name, value in FOLLOWED.items() if getattr(laboratory, name)}:
        plan.append((ALL_FOLLOWED, replace(stage, supposed=True), laboratory.but(**moves), draws[0]))
    total, done = sum(count for *_, count in plan), 0
    ratios: dict[str, Array] = {}
    nominal = ratio(stage, nothing)
    for name, where, own, count in plan:
        found = []
        for number in range(count):
            # The same palm before and after the array is measured.
            found.append(ratio(where, own, [*PARTS, ALL].index(name if name in PARTS else ALL), number))
            done += 1
            if progress is not None:
                progress(done, total)
        ratios[name] = np.array(found)
    stated = {name: ", ".join(_stated(*each) for each in own.items()) for name, own in kept.items()}
    if measured is not None:
        stated |= {"transducers": "as measured", "dead transducers": "as measured", "units": "as measured"}
        stated |= {"echo": "as measured"} if measured.reflection_uncertainty else {}
    return LaboratoryLoss(
        nominal=nominal,
        ratios=ratios,
        stated=stated,
        seed=seed,
        measured=measured is not None,
        place="" if fixed_place else str(Place(shift=(aside, aside), turn=turn)),
    )


def laboratory_of_drive(
    asked: PressureFrames, drive: Drive, settings: Settings, judged: float, **how: Any
) -> LaboratoryLoss:
    """Loss of a drive in a laboratory with the default uncertainties, from few draws.

    `asked` is the target pressure on the cells, from the drive's first frame; its middle `judged` s are compared. `how`
    is `fixed_place` and `progress` of `laboratory_loss`.
    """
    return laboratory_loss(
        asked,
        drive,
        Laboratory(),
        sensor=VirtualRig(cells=asked.sensor).sensor_model,
        grid=settings.target.grid,
        judged=((asked.frames / asked.rate - judged) / 2, judged),
        band=settings.calibration.band,
        draws=(4, 16),
        **how,
    )


def laboratory_of_loop(loop: Loop, **how: Any) -> LaboratoryLoss:
    """Loss of a loop's last pass in a laboratory, as `laboratory_of_drive`."""
    last, original = loop.passes[-1], loop.original
    judged = original.frames / original.rate
    return laboratory_of_drive(last.asked, last.reproduction.solution.drive, loop.settings, judged, **how)


def _stated(name: str, value: float) -> str:
    """A value of `Laboratory` as text, such as "3 mm"."""
    unit = {"mm": "mm", "deg": "deg", "k": "K", "hz": "Hz"}.get(name.rpartition("_")[2])
    return f"{value:g} {unit}" if unit else f"{100 * value:g} %"


def _part(
    asked: PressureFrames, drive: Drive, judged: tuple[float, float]
) -> tuple[PressureFrames, Drive, tuple[float, float]]:
    """The middle of a longer part, with as much before and after it for the filters."""
    start, duration = judged
    if duration <= LONGEST:
        return asked, drive, judged
    middle, end = start + (duration - LONGEST) / 2, asked.frames / asked.rate
    begin = max(0.0, middle - LONGEST)
    piece = asked.cut(begin, min(end, middle + 2 * LONGEST) - begin)
    first = round(begin * drive.rate)
    frames = slice(first, first + round(piece.frames / piece.rate * drive.rate))
    return piece, replace(drive, phase=drive.phase[frames], level=drive.level[frames]), (middle - begin, LONGEST)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stage:
    """A drive above which a palm is laid."""

    drive: Drive
    q: Waves  # Sound of nominal transducers, shape (frame * STEPS, transducer)
    solved: Array  # Middle of the palm of the solve, shape (3,), in m
    there: Array  # Points around the cells, shape (point, 3), in m
    weights: Array  # Those of the cells, shape (cell, point)
    measured: ArrayCalibration | None
    supposed: bool = False
    """Whether an array that was not measured counts as measured."""

    @classmethod
    def of(cls, drive: Drive, sensor: SensorModel, grid: ControlGrid, measured: ArrayCalibration | None) -> "_Stage":
        """Compute what is the same in all laboratories."""
        cells, solved, count = sensor.grid, middle_of(grid), drive.array.count
        # A point beyond the cells on each side: a second one would change the pressure by a thousandth.
        points = ControlGrid(
            rows=3 * cells.rows + 2, columns=3 * cells.columns + 2, pitch=cells.pitch / 3, height=float(solved[2])
        )
        alike = Transducers.alike(count)
        follow = alike if measured is None else replace(alike, pole=measured.pole)
        # A part does not begin in silence: the ringing would reach the compared part.
        start = replace(TransducerState.silent(count), q=drive.q_of(slice(1))[0])
        emitted = radiate(drive, PlaybackChain(phase_bits=None, transducers=follow), STEPS, start=start)
        return cls(
            drive=drive,
            q=np.concatenate([q for q, _ in emitted]),
            solved=solved,
            there=points.position + np.array([solved[0], solved[1], 0.0]),
            weights=cell_weights(sensor, points, between="waves"),
            measured=measured,
        )

    def pressure(self, lab: Laboratory, rng: np.random.Generator) -> Array:
        """Pressure on the cells in one random laboratory, shape (frame * STEPS, cell), in Pa."""
        solved, air = self.solved, self.drive.acoustics
        warmer = air.medium.warmer(float(np.clip(rng.normal(0, lab.temperature_k), -10, 10)))
        acoustics = Acoustics(medium=warmer if lab.temperature_k else air.medium, directivity=air.directivity)
        pose = _pose(lab, solved, rng)
        array = array_from_palm(self._array(lab, rng), solved, pose)
        reflection = lab.reflection and lab.reflection * np.exp(2j * np.pi * rng.random())
        if lab.reflection and self.measured is not None and self.measured.reflection_uncertainty:
            reflection = self.measured.reflection
        palm: Any = {"reflection": reflection, "middle": solved, "precision": "single"}
        matrix = palm_matrix(self.there, array, acoustics=acoustics, **palm)
        return Spread.of(matrix, acoustics.medium, self.weights, "single").pressure(self.q)

    def _array(self, lab: Laboratory, rng: np.random.Generator) -> TransducerArray:
        array, known, solved = self.drive.array, self.measured, self.solved
        response = array.response * self._response(lab, rng)
        place = array.position.copy(), array.normal.copy()
        if lab.unit_position_mm or lab.unit_angle_deg:
            place = self._moved_units(lab, rng)
        frequency = array.frequency * (1 + float(rng.normal(0, lab.frequency)))
        moved = replace(array, position=place[0], normal=place[1], response=response, frequency=frequency)
        if known is None and not self.supposed:
            return moved
        # The measured response contains what a shift of a unit does at the sensor.
        longer = np.linalg.norm(moved.position - solved, axis=1) - np.linalg.norm(array.position - solved, axis=1)
        k = wavenumber(array, self.drive.acoustics.medium)
        return replace(moved, response=response * np.exp(-1j * k * longer))

    def _response(self, lab: Laboratory, rng: np.random.Generator) -> Complex:
        count, known = self.drive.array.count, self.measured
        alive = rng.random(count) >= lab.dead
        if known is None and not self.supposed:
            seed, spread = int(rng.integers(2**32)), lab.resonance_hz
            return (
                alive * Transducers.varied(count, seed=seed, gain_spread=lab.strength, resonance_spread=spread).response
            )
        strength, phase = AS_MEASURED
        if known is not None:
            strength = known.strength_uncertainty / np.maximum(known.strength, 1e-6) * (known.strength > 0)
            phase = known.phase_uncertainty
        size = 1.0 if lab.strength or lab.resonance_hz else 0.0
        turn = size * phase * rng.standard_normal(count)
        return np.asarray((1 + size * strength * rng.standard_normal(count)) * np.exp(1j * turn), np.complex128)

    def _moved_units(self, lab: Laboratory, rng: np.random.Generator) -> tuple[Array, Array]:
        """Positions and normals of the transducers if each unit is shifted and rotated about its middle."""
        array = self.drive.array
        position, normal = array.position.copy(), array.normal.copy()
        units = np.unique(array.unit)
        sizes = np.array([1e-3 * lab.unit_position_mm] * 3 + [np.radians(lab.unit_angle_deg)] * 3)
        draws = sizes * rng.standard_normal((len(units), 6))
        if self.measured is not None and self.measured.pose_covariance.any():
            covariance = self.measured.pose_covariance
            draws = rng.multivariate_normal(np.zeros(len(covariance)), covariance).reshape(-1, 7)[:, :6]
        for unit, draw in zip(units, draws, strict=True):
            its = array.unit == unit
            middle = position[its].mean(axis=0)
            turn = scipy.spatial.transform.Rotation.from_euler("xyz", draw[3:]).as_matrix()
            position[its] = (position[its] - middle) @ turn.T + middle + draw[:3]
            normal[its] = normal[its] @ turn.T
        return position, normal


def _pose(lab: Laboratory, solved: Array, rng: np.random.Generator) -> PalmPath:
    sides = np.array([lab.palm_aside_mm, lab.palm_aside_mm, lab.palm_height_mm])
    angles = np.radians([lab.palm_tilt_deg, lab.palm_tilt_deg, lab.palm_turn_deg])
    offset = 1e-3 * sides * rng.standard_normal(3)
    turned = scipy.spatial.transform.Rotation.from_euler("xyz", angles * rng.standard_normal(3)).as_matrix()
    return PalmPath(
        time=np.zeros(1),
        centre=(solved + offset)[None],
        normal=-turned[None, :, 2],
        fingers=turned[None, :, 1],
        confidence=np.ones(1),
    )
