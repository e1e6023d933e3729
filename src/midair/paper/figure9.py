"""Reproduce the paper's Fig. 9 for the synthetic objects: spectra of the target pressure on both surfaces (5.3)."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from midair.datasets import Object
from midair.dsp import band_energy
from midair.figures import objects_figure, png_bytes
from midair.model import PressureFrames
from midair.paper.result import PaperResult, Row
from midair.pipeline import calibrated_pressure
from midair.progress import report_progress
from midair.rig import VirtualRig, record
from midair.settings import Mode, Settings, paper_mode, with_paper_mode
from midair.targets import MAPPINGS

CHANNELS = (2, 6, 10, 14)
"""Channels that the paper's objects passed over, shown in its Fig. 9."""

BANDS: Mapping[str, tuple[float, float]] = {"20_300_hz": (20.0, 300.0), "300_470_hz": (300.0, 470.0)}


def figure_9(
    *, takes: int = 5, paper: Settings | None = None, best: Settings | None = None, mode: Mode = "best"
) -> PaperResult:
    """Record strokes of the three objects and show the spectra of each mode's target pressure.

    Each object strokes each surface `takes` times, with seeds 0, 1, ...; the paper has five. The first is drawn; the
    numbers are mean powers over all. Of the settings of the paper and of the `mode` to compare, only the mappings are
    used.
    """
    modes = with_paper_mode(mode, paper or paper_mode(), best)
    rows: list[Row] = []
    shown: dict[str, dict[str, PressureFrames]] = {}
    every = list(product(("plain", "groove"), get_args(Object)))
    for surface, name in report_progress(every, len(every)):
        strokes = [_stroke(name, surface, modes["paper"], seed) for seed in range(takes)]
        for which, settings in modes.items():
            push = MAPPINGS[settings.target.mapping]
            pushed = [replace(stroke, pressure=push(stroke.pressure, stroke.rate)) for stroke in strokes]
            shown.setdefault(f"{surface}, {settings.target.mapping}", {})[name] = pushed[0]
            levels = {
                f"level_{band}_db": float(10 * np.log10(np.mean([_power(each, BANDS[band]) for each in pushed])))
                for band in BANDS
            }
            rows.append(
                {"object": name, "surface": surface, "mode": which, "mapping": settings.target.mapping} | levels
            )
    return PaperResult(
        name="figure9",
        title="Spectra of the synthetic objects, as in the paper's Fig. 9",
        rows=tuple(rows),
        pictures={"figure9.png": png_bytes(objects_figure(shown, channels=CHANNELS))},
        about={"takes": takes, "channels": list(CHANNELS), "unit": "dB re 1 Pa^2, mean over takes and channels"},
    )


def _stroke(name: str, surface: str, settings: Settings, seed: int) -> PressureFrames:
    rig = VirtualRig(seed=seed)
    with rig.touched_by(name + ("+groove" if surface == "groove" else "")) as sensor:
        return calibrated_pressure(record(sensor, 1.26).recording, sensor.calibration, settings)


def _power(pushed: PressureFrames, band: tuple[float, float]) -> float:
    signals: NDArray[np.float64] = pushed.pressure.reshape(pushed.frames, -1)[:, list(CHANNELS)]
    return float(band_energy(signals, pushed.rate, band).mean())
