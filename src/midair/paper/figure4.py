"""Reproduce the paper's experiment 5.2: modulated foci, recorded, reproduced and re-recorded, as in its Fig. 4."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from midair.errors import InputError
from midair.evaluate import perceptual_metrics
from midair.figures import png_bytes, stimuli_figure
from midair.model import PressureFrames
from midair.paper.result import PaperResult, Row
from midair.pipeline import calibrated_pressure
from midair.rig import Loop, OpenRig, Stage, VirtualRig, loop, no_progress, record
from midair.settings import Mode, Settings, paper_mode, with_paper_mode

STIMULI: Mapping[str, str] = MappingProxyType(
    {"i: 100 Hz": "am-i", "ii: two points": "am-ii", "iii: 25 + 250 Hz": "am-iii"}
)
"""Names of the paper's three stimuli in the virtual rig."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StimuliPlan:
    """Settings of experiment 5.2."""

    paper: Settings = field(default_factory=paper_mode)
    best: Settings | None = None
    """Settings of the other mode; its defaults if None."""
    mode: Mode = "best"
    """Mode to compare with the paper's."""
    duration: float = 0.12
    """Duration of each stimulus in s: a multiple of 40 ms, at least 80 ms, for the spectra."""
    corrections: int = 1
    """Amplitude corrections in both modes; the paper has one."""
    iterate: int = 1
    """Waveform corrections in the other mode only."""
    rig: VirtualRig = field(default_factory=VirtualRig)

    def __post_init__(self) -> None:
        periods = self.duration / 0.04
        if periods < 2 or not np.isclose(periods, round(periods)):
            raise InputError(
                f"duration: expected a multiple of 40 ms, 80 ms or more, for figure 4, got {1e3 * self.duration:g} ms"
            )


def figure_4(plan: StimuliPlan | None = None, *, stage: Stage = no_progress) -> PaperResult:
    """Record, reproduce and re-record stimuli i to iii in both modes; call `stage` with the name of each stage."""
    plan = plan or StimuliPlan()
    rows: list[Row] = []
    shown: dict[str, dict[str, PressureFrames]] = {}
    for name, thing in STIMULI.items():
        for which, settings in with_paper_mode(plan.mode, plan.paper, plan.best).items():
            mode, iterate = f"{which} mode", 0 if which == "paper" else plan.iterate
            original = recorded(plan.rig, thing, settings, plan.duration)
            loop = reproduced(
                original, plan, settings, iterate, lambda what, m=mode, n=name: stage(f"{n[:3]} {m}: {what}")
            )
            shown.setdefault(name, {"original": original})[mode] = loop.passes[-1].felt
            rows.append(_row(thing, mode, loop))
    return PaperResult(
        name="figure4",
        title="Modulated foci, original and re-recorded, as in the paper's Fig. 4",
        rows=tuple(rows),
        pictures={"figure4.png": png_bytes(stimuli_figure(shown))},
        about={"duration_s": plan.duration, "amplitude_corrections": plan.corrections, "best_iterations": plan.iterate},
    )


def recorded(rig: VirtualRig, thing: str, settings: Settings, duration: float) -> PressureFrames:
    """Recording of an object by the virtual sensor, without the first 80 ms in which the sensor settles."""
    settle = 0.08
    with rig.touched_by(thing, duration=duration + settle) as sensor:
        pressure = calibrated_pressure(record(sensor, duration + settle).recording, sensor.calibration, settings)
    return pressure.cut(settle, duration)


def reproduced(original: PressureFrames, plan: StimuliPlan, settings: Settings, iterate: int, stage: Stage) -> Loop:
    """Run the loop for one stimulus in one mode."""
    skin = plan.rig.skin()
    with OpenRig(array=plan.rig.array_device(skin), sensor=plan.rig.sensor(skin)) as rig:
        return loop(
            original,
            settings,
            rig,
            corrections=plan.corrections,
            iterate=iterate,
            stage=stage,
        )


def _row(thing: str, mode: str, loop: Loop) -> Row:
    last = loop.passes[-1]
    comparison, card = last.comparison, perceptual_metrics(loop.original, last.felt)
    return {
        "stimulus": thing,
        "mode": mode,
        "passes": len(loop.passes),
        "strength": last.reproduction.strength(),
        "solver_error": float(last.reproduction.solution.error.mean()),
        "correlation": comparison.correlation,
        "gain": comparison.gain,
        "waveform_error": comparison.waveform_error,
        "sdr_db": comparison.distortion_ratio,
        "peak_distance_mm": 1e3 * comparison.peak_distance,
        "frequency_original_hz": comparison.frequency[0],
        "frequency_reproduced_hz": comparison.frequency[1],
        "st_sim": card.figure("ST-SIM").overall,
        "spqi": card.figure("SPQI").overall,
        "pacinian_difference_db": card.figure("Pacinian power difference").overall,
    }
