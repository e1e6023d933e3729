"""Reproduce the paper's Fig. 3: binary patterns and the fields solved for them (5.1)."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from midair.array_types import Array
from midair.datasets import channel_amplitudes
from midair.evaluate import Leak, leak, printed_error, relative_error
from midair.figures import FieldRow, fields_figure, png_bytes
from midair.model import (
    HEIGHT,
    Acoustics,
    AmplitudeFrames,
    ControlGrid,
    Drive,
    Medium,
    Provenance,
    SensorGrid,
    TransducerArray,
)
from midair.paper.result import PaperResult, Row
from midair.physics import focus_amplitude, propagate
from midair.pipeline import solve_with
from midair.progress import report_progress
from midair.settings import MODES, Mode, Settings, paper_mode, with_paper_mode
from midair.targets import interpolation_matrix

PATTERNS: Mapping[str, int] = MappingProxyType(
    {
        "one corner": 0b0000_0000_0000_0001,
        "two corners": 0b1000_0000_0000_0001,
        "diagonal": 0b1000_0100_0010_0001,
        "middle": 0b0000_0110_0110_0000,
        "ring": 0b1111_1001_1001_1111,
        "chequered": 0b1010_0101_1010_0101,
    }
)
"""Bit k is 1 if channel k is active."""


def figure_3(
    *, strength: float = 0.15, paper: Settings | None = None, best: Settings | None = None, mode: Mode = "best"
) -> PaperResult:
    """Solve patterns in both modes, from a cold start and for point sources without attenuation as in the paper.

    `strength` is the target over the peak of a single focus of the whole array, which the paper does not state. Of the
    settings of the paper and of the `mode` to compare, only grid, solver and terms are used.
    """
    array, sensor = TransducerArray.autd3(), SensorGrid()
    acoustics = Acoustics(medium=Medium(attenuation=0.0), directivity="point")
    cold = (paper or paper_mode().but(method="lm", iterations=(50, 50))).but(start="zero", acoustics=acoustics)
    # Patterns are not a sequence, so phases need not be continuous.
    still = (best or MODES[mode]()).but(method="fast", fit="points", acoustics=acoustics)
    modes = with_paper_mode(mode, cold, still)
    rows: list[Row] = []
    shown: list[FieldRow] = []
    for name_of_mode, settings in report_progress(modes.items(), len(modes)):
        grid = settings.target.grid
        focus = focus_amplitude(grid, array, acoustics=acoustics)
        cells = channel_amplitudes(np.array(list(PATTERNS.values())), sensor)
        amplitude = strength * focus * cells @ interpolation_matrix(sensor, grid).T
        target = AmplitudeFrames(
            amplitude=amplitude, rate=1.0, grid=grid, provenance=Provenance(source="patterns", simulated=True)
        )
        drive = solve_with(target, array, settings).drive
        field = propagate(drive, grid)
        error, printed = relative_error(field, amplitude), printed_error(field, amplitude)
        if not shown:
            shown.append(FieldRow(name="target", fields=amplitude / focus, grid=grid, notes=tuple(PATTERNS)))
        notes: list[str] = []
        for number, name in enumerate(PATTERNS):
            outside = _leak(drive, amplitude, number, grid)
            notes.append(f"E {100 * error[number]:.1f} %, leak {100 * outside.peak:.0f} %")
            rows.append(
                {
                    "pattern": name,
                    "mode": name_of_mode,
                    "strength": strength,
                    "error": float(error[number]),
                    "error_as_printed": float(printed[number]),
                    "leak": outside.peak,
                }
            )
        shown.append(FieldRow(name=f"{name_of_mode} mode", fields=np.abs(field) / focus, grid=grid, notes=tuple(notes)))
    return PaperResult(
        name="figure3",
        title="Binary patterns and their fields, as in the paper's Fig. 3",
        rows=tuple(rows),
        pictures={"figure3.png": png_bytes(fields_figure(shown, sensor, quantity="sound pressure over a full focus"))},
        about={"strength": strength, "height_m": HEIGHT, "array": array.name, "sources": "points, no attenuation"},
    )


def _leak(drive: Drive, amplitude: Array, number: int, grid: ControlGrid) -> Leak:
    part = slice(number, number + 1)
    one = replace(drive, phase=drive.phase[part], level=drive.level[part])
    return leak(one, amplitude[part], grid)
