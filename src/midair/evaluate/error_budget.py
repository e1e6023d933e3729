"""Error budget: the loss in each stage of a reproduction and in a real laboratory, and the fidelity after it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from midair.array_types import Array
from midair.dsp import Band
from midair.evaluate.distortion import Fidelity, fidelity, finite
from midair.evaluate.drive_error import Leak
from midair.evaluate.palm_metrics import PalmFidelity
from midair.model import BAND, PressureFrames

ALL = "all together"

ADVICE: Mapping[str, str] = {
    "palm sideways": "support the hand and mark its place, or follow it with --follow",
    "palm height": "support the hand at the height of the solve, or follow it with --follow",
    "palm tilt": "support wrist and fingers at the same height, or follow the hand with --follow",
    "palm rotation": "mark the direction of the fingers, or solve for the rotated palm",
    "temperature": "measure it and solve with --temperature, or play with --correct-air",
    "units": "measure their places with midair calibrate array, or state them with --placement",
    "transducers": "measure them with midair calibrate array",
    "dead transducers": "find them with midair calibrate array, which the solver then takes into account",
    "frequency": "measure the frequency of the ultrasound",
    "echo": "tilt the palm or the array by some degrees, or lay a cloth on the array around the transducers",
}
"""What to do about each uncertainty."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaboratoryLoss:
    """Signal to distortion with one gain for all cells, over random draws of the uncertainties of a laboratory."""

    nominal: float
    """Without any uncertainty, in dB."""
    ratios: Mapping[str, Array]
    """Signal to distortion of each draw in dB, by uncertainty; `ALL` for all of them at once."""
    stated: Mapping[str, str]
    """Size of each uncertainty as text."""
    seed: int
    """Seed of the draws."""
    measured: bool = False
    """Whether the transducers were measured; then only the uncertainty of the measurement remains."""

    @property
    def largest(self) -> str:
        """The uncertainty with the lowest median."""
        return min((name for name in self.ratios if name != ALL), key=lambda name: float(np.median(self.ratios[name])))

    @property
    def advice(self) -> str:
        """One line: the largest uncertainty and what to do about it."""
        name = self.largest
        lost = self.nominal - float(np.median(self.ratios[name]))
        return f"largest: {name} ({self.stated[name]}), which loses {lost:.1f} dB: {ADVICE[name]}"

    def rows(self) -> list[tuple[str, str, float, float, float]]:
        """Name, size, median, 5th and 95th percentile of each uncertainty in dB, the largest loss first."""
        order = sorted(self.ratios, key=lambda name: (name == ALL, float(np.median(self.ratios[name]))))
        found = [(name, np.percentile(self.ratios[name], [50, 5, 95])) for name in order]
        return [(name, self.stated[name], float(mid), float(low), float(high)) for name, (mid, low, high) in found]

    def plain(self) -> dict[str, object]:
        """Values for JSON."""
        return {
            "nominal_db": self.nominal,
            "seed": self.seed,
            "measured_array": self.measured,
            "uncertainties": {
                name: {
                    "stated": said,
                    "median_db": mid,
                    "low_db": low,
                    "high_db": high,
                    "draws": len(self.ratios[name]),
                }
                for name, said, mid, low, high in self.rows()
            },
            "largest": self.largest,
            "advice": ADVICE[self.largest],
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
    kept: float | None
    """Part of the recording's power in the band; None if unknown."""
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

    def plain(self) -> dict[str, object]:
        """Values of the whole budget for JSON."""
        return {
            "simulated": self.simulated,
            "band_hz": list(self.band),
            "kept_in_band": self.kept,
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
    kept: float | None = None,
    band: Band = BAND,
    images: Band = (530.0, 1000.0),
    judged: tuple[float, float] | None = None,
    palm: PalmFidelity | None = None,
) -> Budget:
    """Compare the output of each stage with its input and with the original.

    `original` is the recorded pressure in the band. `outputs` are in processing order, all on the original's cells and
    with the same start and duration. `strength`, `kept` and `palm` are fields of `Budget`; `band`, `images` and
    `judged` are as in `fidelity`.
    """
    lines: list[StageLoss] = []
    before = original
    for output in outputs:
        compared = partial(fidelity, delivered=output.pressure, band=band, images=images, judged=judged)
        so_far = compared(output.reference or original, noise=output.noise)
        alone = so_far if before is original else compared(before)
        if not output.tells_images:
            so_far, alone = replace(so_far, images=None), replace(alone, images=None)
        lines.append(StageLoss(name=output.name, what=output.what, alone=alone, so_far=so_far, leak=output.leak))
        before = output.pressure
    simulated = original.provenance.simulated or any(each.pressure.provenance.simulated for each in outputs)
    return Budget(stages=tuple(lines), kept=kept, band=band, strength=strength, simulated=simulated, palm=palm)
