"""An error budget: what each stage of one reproduction loses, and what is left after it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from midair.evaluate.distortion import Band, Fidelity, fidelity
from midair.evaluate.leakage import Leak
from midair.evaluate.palm_metrics import PalmFidelity
from midair.model import PressureFrames


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageOutput:
    """The pressure on the cells as it would be if everything after a stage were perfect.

    Attributes
    ----------
    name : str
        Name of the stage.
    what : str
        What it does, in one line.
    pressure : PressureFrames
        After it.
    leak : Leak or None
        Outside the square, where there is a field to tell it from.
    reference : PressureFrames or None
        What to compare it with in place of the original: what a perfect stage would give.
    tells_images : bool
        Whether it reaches up to the images; a sensor at 1 kHz does not, at whatever rate its pressure is given.
    """

    name: str
    what: str
    pressure: PressureFrames
    leak: Leak | None = None
    reference: PressureFrames | None = None
    tells_images: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class StageLoss:
    """One line of a budget.

    Attributes
    ----------
    name, what : str
        Name of the stage, and what it does.
    alone : Fidelity
        Comparison of the stage's output with its input: what this stage does.
    so_far : Fidelity
        Comparison of the stage's output with the original: what has come through.
    leak : Leak or None
        Pressure outside the square of control points.
    """

    name: str
    what: str
    alone: Fidelity
    so_far: Fidelity
    leak: Leak | None = None

    def plain(self) -> dict[str, object]:
        """Plain values for JSON; what cannot be told is null."""
        return {
            "stage": self.name,
            "what": self.what,
            "sdr_alone_db": finite(self.alone.distortion_ratio),
            "sdr_so_far_db": finite(self.so_far.distortion_ratio),
            "sdr_overall_db": finite(self.so_far.overall_ratio),
            "images_db": finite(self.so_far.images),
            "spatial_correlation": self.so_far.spatial_correlation,
            "gain": self.so_far.gain,
            "delay_s": self.so_far.delay,
            "leak": None if self.leak is None else self.leak.peak,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What became of one recording on its way to the palm.

    Attributes
    ----------
    stages : tuple of StageLoss
        In the order of the way.
    kept : float or None
        Part of the recording's power that lies in the band; None where it is not known.
    band : tuple of float
        (low, high) that signal and distortion are measured in, in Hz.
    strength : float
        Strength of the target.
    simulated : bool
        Whether any part of it was simulated.
    palm : PalmFidelity or None
        What a whole palm gets of what is played; None where nobody looked.
    """

    stages: tuple[StageLoss, ...]
    kept: float | None
    band: Band
    strength: float
    simulated: bool
    palm: PalmFidelity | None = None

    def stage(self, name: str) -> StageLoss:
        """The line of this name."""
        return next(each for each in self.stages if each.name == name)

    def plain(self) -> dict[str, object]:
        """Plain values of the whole budget, for JSON."""
        return {
            "simulated": self.simulated,
            "band_hz": list(self.band),
            "kept_in_band": self.kept,
            "strength": self.strength,
            "stages": [stage.plain() for stage in self.stages],
            "palm": None if self.palm is None else self.palm.plain(),
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
    band: Band = (20.0, 470.0),
    images: Band = (530.0, 1000.0),
    judged: tuple[float, float] | None = None,
    palm: PalmFidelity | None = None,
) -> Budget:
    """Compare the output of each stage with its input, and with the original.

    Parameters
    ----------
    original : PressureFrames
        What was felt, in the band.
    outputs : sequence of StageOutput
        In the order of the way, all on the original's cells and of the same time.
    strength : float
        Strength of the target.
    kept : float, optional
        Part of the recording's power that lies in the band.
    band, images, judged : tuple of float
        As in `fidelity`.
    palm : PalmFidelity, optional
        What a whole palm gets.
    """
    lines: list[StageLoss] = []
    before = original
    for output in outputs:
        compared = partial(fidelity, delivered=output.pressure, band=band, images=images, judged=judged)
        so_far = compared(output.reference or original)
        alone = so_far if before is original else compared(before)
        if not output.tells_images:
            so_far, alone = replace(so_far, images=None), replace(alone, images=None)
        lines.append(StageLoss(name=output.name, what=output.what, alone=alone, so_far=so_far, leak=output.leak))
        before = output.pressure
    simulated = original.provenance.simulated or any(each.pressure.provenance.simulated for each in outputs)
    return Budget(stages=tuple(lines), kept=kept, band=band, strength=strength, simulated=simulated, palm=palm)


def finite(value: float | None) -> float | None:
    """`value`, or None where JSON has no word for it."""
    return value if value is not None and math.isfinite(value) else None
