"""Error of a drive, and error budget: the loss in each stage and in a real laboratory, and the fidelity after it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.dsp import Band
from midair.errors import MismatchError
from midair.evaluate.distortion import Fidelity, fidelity, finite
from midair.evaluate.palm_metrics import PalmFidelity
from midair.model import BAND, Acoustics, AmplitudeFrames, ControlGrid, Drive, Medium, PressureFrames
from midair.physics import propagate, radiation_pressure, relative_error
from midair.streaming import blocks

FAINT = 1e-2
"""Frames with less than this part of the strongest frame's power are faint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveError:
    """Error of a solved target."""

    energy: float
    """Root of the error's power over the target's power, all frames together."""
    mean: float
    """Mean over the frames that are not faint."""
    worst: float
    """Maximum over the frames that are not faint."""
    faint: int
    """Number of faint frames."""
    frames: int
    """Number of all frames that are not silent."""
    faint_mean: float
    """Mean error of the faint frames; 0 without any."""

    def __str__(self) -> str:
        return f"{100 * self.energy:.1f} %, worst frame {100 * self.worst:.1f} %"

    def faint_text(self) -> str:
        """The error of the faint frames; empty without any."""
        error = f"mean {100 * self.faint_mean:.0f} %" if self.faint_mean <= 1 else "too loud, --set solver.level=auto"
        text = f"{self.faint} of {self.frames} have less than 1 % of the loudest's power: {error}"
        return text if self.faint else ""

    def plain(self) -> dict[str, object]:
        """Ratios for JSON."""
        return {
            "E_energy": self.energy,
            "E_mean": self.mean,
            "E_worst": self.worst,
            "faint_frames": self.faint,
            "E_faint": self.faint_mean,
        }


def error_by_energy(error: Array, power: Array) -> SolveError:
    """Summarise the errors E of frames, weighted with their targets' power in any unit; silent frames are ignored."""
    plays = power > 0
    error, power = error[plays], power[plays]
    if not len(error):
        return SolveError(energy=0.0, mean=0.0, worst=0.0, faint=0, frames=0, faint_mean=0.0)
    faint = power < FAINT * power.max()
    return SolveError(
        energy=float(np.sqrt((error**2 * power).sum() / power.sum())),
        mean=float(error[~faint].mean()),
        worst=float(error[~faint].max()),
        faint=int(faint.sum()),
        frames=len(error),
        faint_mean=float(error[faint].mean()) if faint.any() else 0.0,
    )


def error_at_temperature(drive: Drive, target: AmplitudeFrames, medium: Medium, *, frames: int | None = None) -> Array:
    """Compute the error E of a drive at the control points in another medium than its own.

    The target pressure stays the same; the required sound pressure depends on density and speed of sound. The result is
    ``|| |G q| - p || / || p ||`` of each computed frame, empty if all frames are silent.

    `target` is the one that the drive was solved for, `medium` the air in which it is played. Only `frames` evenly
    spaced frames among those that are not silent are computed; all if None. Raises MismatchError if target and drive
    differ in their number of frames.
    """
    if target.frames != drive.frames:
        raise MismatchError(f"target: expected {drive.frames} frames as in the drive, got {target.frames}")
    some = np.flatnonzero(np.concatenate([block.any(axis=1) for block in blocks(target.amplitude)]))
    if frames is not None and len(some) > frames:
        some = some[np.linspace(0, len(some) - 1, frames).round().astype(int)]
    if not len(some):
        return np.zeros(0)
    # Select the frames first: a copy of the whole drive would be as large as its file.
    part = replace(drive, phase=drive.phase[some], level=drive.level[some])
    field = propagate(part, target.grid, acoustics=replace(drive.acoustics, medium=medium))
    here, there = (float(radiation_pressure(np.ones(1), each)[0]) for each in (drive.acoustics.medium, medium))
    return relative_error(field, target.amplitude[some] * np.sqrt(here / there))


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """Radiation pressure outside the controlled square, relative to the highest target pressure inside."""

    peak: float
    """Highest pressure outside over all frames, relative to the highest target pressure of all frames."""
    typical: float
    """Median over the frames of the highest pressure outside, relative to the same."""
    place: tuple[float, float]
    """(x, y) of the highest pressure outside, from the centre of the grid, in m."""
    wanted: float
    """Highest target pressure in Pa."""


def surroundings(grid: ControlGrid) -> tuple[ControlGrid, NDArray[np.bool_]]:
    """Create a larger grid around a control grid, with a mask (point,) of its points outside the square.

    The square ends half a pitch beyond the outermost control points. The larger grid has a margin of 20 mm around it
    and a pitch of 2.5 mm, a third of a wavelength at 40 kHz.
    """
    reach, pitch = 0.02, 2.5e-3
    half_x, half_y = grid.columns * grid.pitch / 2, grid.rows * grid.pitch / 2
    rows, columns = (2 * int(np.ceil((half + reach) / pitch)) + 1 for half in (half_y, half_x))
    around = ControlGrid(rows=rows, columns=columns, pitch=pitch, height=grid.height, centre=grid.centre)
    x, y = np.meshgrid(around.x, around.y)
    # The tolerance keeps points on the edge inside despite rounding.
    outside = (np.abs(x) > half_x + 1e-9) | (np.abs(y) > half_y + 1e-9)
    return around, outside.ravel()


def leak(drive: Drive, amplitude: Array, grid: ControlGrid, *, acoustics: Acoustics | None = None) -> Leak:
    """Compute the pressure of a drive outside the square that it was solved for.

    `amplitude`, shape (frame, point), is the target at the points of `grid`, peak sound pressure in Pa; `acoustics` are
    those of the drive by default. 64 evenly spaced frames are computed, besides the strongest one.
    """
    acoustics = acoustics or drive.acoustics
    wanted = radiation_pressure(amplitude, acoustics.medium)
    chosen = np.unique(np.linspace(0, drive.frames - 1, min(64, drive.frames)).astype(int))
    # Include the strongest frame, because its pressure is the reference.
    chosen = np.union1d(chosen, [int(np.argmax(wanted.max(axis=1)))])
    around, outside = surroundings(grid)
    part = Drive(phase=drive.phase[chosen], level=drive.level[chosen], rate=drive.rate, array=drive.array)
    field = propagate(part, around, acoustics=acoustics)
    pressure = np.where(outside, radiation_pressure(field, acoustics.medium), 0.0)
    top = float(wanted.max())
    hottest = pressure.max(axis=1)
    row, column = divmod(int(np.argmax(pressure[int(np.argmax(hottest))])), around.columns)
    over = hottest / top if top > 0 else np.zeros(len(hottest))
    return Leak(
        peak=float(over.max()),
        typical=float(np.median(over)),
        place=(float(around.x[column]), float(around.y[row])),
        wanted=top,
    )


ALL, ALL_MEASURED, ALL_FOLLOWED = "all together", "all, array measured", "all, palm followed"

ADVICE: Mapping[str, str] = {
    "palm sideways": "support the hand and mark its place",
    "palm height": "support the hand at the height of the solve, or solve for a greater one with --height",
    "palm tilt": "support wrist and fingers at the same height",
    "palm rotation": "mark the direction of the fingers, or solve for the rotated palm",
    "temperature": "measure it and solve with --temperature, or play with --correct-air",
    "units": "measure their places with midair calibrate array, or state them with --placement",
    "transducers": "measure them with midair calibrate array",
    "dead transducers": "find them with midair calibrate array, which the solver then takes into account",
    "frequency": "measure the frequency of the ultrasound",
    "": "no uncertainty is stated but the place of the palm in its plane",
    "echo": "tilt the palm by 15 degrees about the array's long side, or lay a cloth around the transducers",
}
"""Remedy of each uncertainty."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaboratoryLoss:
    """Signal to distortion with one gain for all cells, over random draws of the uncertainties of a laboratory."""

    nominal: float
    """Without any uncertainty, in dB."""
    ratios: Mapping[str, Array]
    """Signal to distortion of each draw in dB, by uncertainty; `ALL` for all of them at once, `ALL_MEASURED` for the
    same laboratories after the array is measured, `ALL_FOLLOWED` if then a tracker also follows the palm."""
    stated: Mapping[str, str]
    """Size of each uncertainty as text."""
    seed: int
    """Seed of the draws."""
    measured: bool = False
    """Whether the transducers were measured; then only the uncertainty of the measurement remains."""
    place: str = ""
    """Place of the palm in words, if its shift and turn in the plane are no distortion."""

    @property
    def largest(self) -> str | None:
        """The uncertainty with the lowest median; None if there is none but the place of the palm."""
        return min(ADVICE.keys() & self.ratios.keys(), key=lambda name: np.median(self.ratios[name]), default=None)

    def text(self) -> str:
        """Result with all uncertainties in one line."""
        name = ALL_MEASURED if ALL_MEASURED in self.ratios else ALL
        middle, low, high = np.percentile(self.ratios[name], [50, 5, 95])
        known = self.measured or name == ALL_MEASURED
        said = f"{middle:.0f} dB ({low:.0f} to {high:.0f}), array {'measured' if known else 'not measured'}"
        return said if name == ALL else f"{said}; {np.median(self.ratios[ALL]):.0f} dB if not"

    @property
    def remedy(self) -> str:
        """Return the remedy of the largest uncertainty; to follow a palm only where that gains 1 dB and more."""
        known = self.ratios.get(ALL_MEASURED, self.ratios[ALL])
        followed = self.ratios.get(ALL_FOLLOWED, known)
        # The same palms: there are fewer draws with a tracker.
        gained = float(np.median(followed) - np.median(known[: len(followed)]))
        follow = (self.largest or "").startswith("palm") and gained >= 1
        return ADVICE[self.largest or ""] + (
            f", or follow it with --follow, which gains {gained:.0f} dB" if follow else ""
        )

    @property
    def advice(self) -> str:
        """One line: the largest uncertainty and what to do about it."""
        name = self.largest
        lost = self.nominal - float(np.median(self.ratios[name or ALL]))
        risk = f"the biggest risk, {name} ({self.stated[name]}), costs {lost:.1f} dB: " if name else ""
        return risk + self.remedy

    def rows(self) -> list[tuple[str, str, float, float, float]]:
        """Name, size, median, 5th and 95th percentile of each uncertainty in dB, the largest loss first."""
        order = sorted(self.ratios, key=lambda name: (name not in ADVICE, float(np.median(self.ratios[name]))))
        found = ((name, np.percentile(self.ratios[name], [50, 5, 95])) for name in order)
        return [
            (name, self.stated.get(name, ""), float(mid), float(low), float(high)) for name, (mid, low, high) in found
        ]

    def plain(self) -> dict[str, object]:
        """Values for JSON."""
        names = ("stated", "median_db", "low_db", "high_db")
        return {
            "nominal_db": self.nominal,
            "seed": self.seed,
            "measured_array": self.measured,
            "place": self.place or None,
            "uncertainties": {
                name: dict(zip(names, figures, strict=True)) | {"draws": len(self.ratios[name])}
                for name, *figures in self.rows()
            },
            "largest": self.largest,
            "advice": self.remedy,
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageOutput:
    """Pressure on the cells after a stage, if all later stages were perfect."""

    name: str
    what: str
    """Description of the stage in one line."""
    pressure: PressureFrames
    """Pressure after the stage."""
    leak: Leak | None = None
    """Pressure outside the square, if the stage has a field."""
    reference: PressureFrames | None = None
    """Output of a perfect stage, compared instead of the original."""
    noise: Array | None = None
    """Rms noise of the sensor in the pressure, in the band, in Pa, shape (row, column)."""
    tells_images: bool = True
    """Whether the bandwidth includes the images; that of a 1 kHz sensor does not, at any output rate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageLoss:
    """One line of a budget."""

    name: str
    what: str
    """Description of the stage."""
    alone: Fidelity
    """Output of the stage compared with its input."""
    so_far: Fidelity
    """Output of the stage compared with the original."""
    leak: Leak | None = None
    """Pressure outside the square of control points."""

    def plain(self) -> dict[str, object]:
        """Values for JSON; infinite or unknown values are null."""
        return {
            "stage": self.name,
            "what": self.what,
            "sdr_alone_db": finite(self.alone.distortion_ratio),
            "sdr_so_far_db": finite(self.so_far.distortion_ratio),
            "sdr_overall_db": finite(self.so_far.overall_ratio),
            "ratios_db": {name: finite(ratio[0]) for name, ratio in self.so_far.ratios.items()},
            "images_db": finite(self.so_far.images),
            "spatial_correlation": self.so_far.spatial_correlation,
            "gain": self.so_far.gain,
            "delay_s": self.so_far.delay,
            "leak": None if self.leak is None else self.leak.peak,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """Error budget of one recording from the sensor to the palm."""

    stages: tuple[StageLoss, ...]
    """In processing order."""
    left_out: str
    """Part of the recording that is not reproduced; empty if it is small or unknown."""
    band: Band
    """(low, high) in Hz of signal and distortion."""
    strength: float
    """Target peak over the peak of a single focus."""
    simulated: bool
    """Whether any part was simulated."""
    palm: PalmFidelity | None = None
    """Fidelity over a whole palm, if it was computed."""
    laboratory: LaboratoryLoss | None = None
    """Loss in a laboratory, if its uncertainties were stated."""

    def stage(self, name: str) -> StageLoss:
        """Return the line with this name."""
        return next(each for each in self.stages if each.name == name)

    def losses(self) -> list[tuple[StageLoss, float]]:
        """Return what stages cost of 60 dB, the largest first; together they leave what the last stage leaves.

        Later stages may cancel distortion: of stages up to the best ratio that follows, the one with the most
        distortion has the loss, except what is done beforehand.
        """
        found, left, stages = list[tuple[StageLoss, float]](), 60.0, list(self.stages)
        while stages:
            ratios = [min(each.so_far.distortion_ratio, 60.0) for each in stages]
            best = int(np.argmax(ratios))
            some = [each for each in stages[: best + 1] if each.name != "beforehand"] or stages[:1]
            found.append((min(some, key=lambda each: each.alone.distortion_ratio), left - ratios[best]))
            left, stages = ratios[best], stages[best + 1 :]
        return sorted(found, key=lambda each: -each[1])

    def plain(self) -> dict[str, object]:
        """Values of the whole budget for JSON."""
        return {
            "simulated": self.simulated,
            "band_hz": list(self.band),
            "left_out": self.left_out,
            "losses_db": {stage.name: loss for stage, loss in self.losses()},
            "strength": self.strength,
            "stages": [stage.plain() for stage in self.stages],
            "palm": None if self.palm is None else self.palm.plain(),
            "laboratory": None if self.laboratory is None else self.laboratory.plain(),
        }

    def __repr__(self) -> str:
        last = self.stages[-1]
        said = f"{len(self.stages)} stages, {last.so_far.distortion_ratio:.1f} dB after {last.name}"
        return f"<Budget {said}, strength {self.strength:.3g}{', SIMULATED' if self.simulated else ''}>"


def budget(
    original: PressureFrames,
    outputs: Sequence[StageOutput],
    *,
    strength: float,
    band: Band = BAND,
    judged: tuple[float, float] | None = None,
    palm: PalmFidelity | None = None,
) -> Budget:
    """Compare the output of each stage with its input and with the original.

    `original` is the recorded pressure in the band. `outputs` are in processing order, all on the original's cells and
    with the same start and duration. `strength` and `palm` are fields of `Budget`; `band` and `judged` are as
    in `fidelity`.
    """
    lines: list[StageLoss] = []
    before = original
    for output in outputs:
        compared = partial(fidelity, delivered=output.pressure, band=band, judged=judged)
        so_far = compared(output.reference or original, noise=output.noise)
        alone = so_far if before is original else compared(before)
        if not output.tells_images:
            so_far, alone = replace(so_far, images=None), replace(alone, images=None)
        lines.append(StageLoss(name=output.name, what=output.what, alone=alone, so_far=so_far, leak=output.leak))
        before = output.pressure
    simulated = original.provenance.simulated or any(each.pressure.provenance.simulated for each in outputs)
    left_out = str(original.provenance.last("not reproduced").get("text", ""))
    return Budget(stages=tuple(lines), left_out=left_out, band=band, strength=strength, simulated=simulated, palm=palm)
