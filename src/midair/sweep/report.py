"""Reports of sweeps over patterns and over recordings: tables in CSV, figures in PNG."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.array_types import Array
from midair.datasets import channel_amplitudes
from midair.errors import InputError
from midair.figures import curve_figure, histogram_figure, png_bytes, trials_figure
from midair.files import csv_text, from_plain, parse_errors, write_file
from midair.model import SensorGrid
from midair.progress import report_progress
from midair.sweep.patterns import PatternSweep
from midair.sweep.run import SweepResults

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]

PUBLISHED = (0.05, 0.15)  # Range of the average error that the paper reports for these patterns (5.1)


def sweep_report(results: SweepResults) -> dict[str, list[Row]]:
    """Compute the tables of a sweep, which may be incomplete, by name.

    Patterns: conditions, and channels (by the number of active ones); recordings: trials. Raises InputError if nothing
    is solved yet, BrokenFileError if the settings are damaged.
    """
    if not np.isfinite(results.error).any():
        raise InputError(f"sweep: expected solved {results.kind}, got none; continue with midair sweep {results.kind}")
    with parse_errors("sweep", "settings and results of midair"):
        if results.kind == "recordings":
            return {"trials": _trials(results)}
        active = channel_amplitudes(from_plain(PatternSweep, results.settings).patterns(), SensorGrid()).sum(axis=1)
        counts = range(1, SensorGrid().count + 1)
        channels = [{"channels": n} | row for n in counts for row in _conditions(results, active == n)]
        return {"conditions": _conditions(results, slice(None)), "channels": channels}


def write_sweep_report(results: SweepResults, folder: Path) -> list[Path]:
    """Write the tables, and figures of them, into a folder, which is created if necessary; return the paths."""
    tables = sweep_report(results)
    content: dict[str, str | bytes] = {f"{name}.csv": csv_text(rows) for name, rows in tables.items()}
    figures = {"trials": trials_figure(tables["trials"])} if "trials" in tables else _pattern_figures(results, tables)
    for name, figure in report_progress(figures.items(), len(figures)):
        content[f"{name}.png"] = png_bytes(figure)
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in content.items():
        write_file(folder / name, data)
    return [folder / name for name in content]


def _spread(error: Array, rounded: Array) -> Row:
    low, middle, high = np.percentile(error, [5, 50, 95])
    return {
        "mean": float(error.mean()),
        "sd": float(error.std(ddof=1)) if len(error) > 1 else 0.0,
        "p5": float(low),
        "median": float(middle),
        "p95": float(high),
        "worst": float(error.max()),
        "share_5_to_15": float(np.mean((error >= PUBLISHED[0]) & (error <= PUBLISHED[1]))),
        "mean_rounded": float(rounded.mean()),
        "worst_rounded": float(rounded.max()),
    }


def _conditions(results: SweepResults, some: Any) -> list[Row]:
    """One row per condition with results among `some` patterns, a slice or a mask."""
    sweep, rows = from_plain(PatternSweep, results.settings), list[Row]()
    for number, (height, strength) in enumerate(sweep.conditions()):
        error, rounded = results.error[number, some], results.rounded_error[number, some]
        if (known := np.isfinite(error)).any():
            where = {"strength": strength, "height_mm": round(1e3 * height, 6), "patterns": int(known.sum())}
            worst = {"worst_pattern": f"{sweep.patterns()[some][np.nanargmax(error)]:#06x}"}
            rows.append(where | _spread(error[known], rounded[known]) | worst)
    return rows


def _pattern_figures(results: SweepResults, tables: dict[str, list[Row]]) -> "dict[str, Figure]":
    """The histogram of the first three conditions; E over strength and over height where there are three values."""
    conditions = from_plain(PatternSweep, results.settings).conditions()
    errors = {f"strength {s:g}, {1e3 * h:g} mm": results.error[n] for n, (h, s) in enumerate(conditions)}
    known = [(name, error[np.isfinite(error)]) for name, error in errors.items() if np.isfinite(error).any()]
    figures = {"histogram": histogram_figure(known[:3], published=PUBLISHED)}
    for name, key, other, label in (
        ("strength", "strength", "height_mm", "{:g} mm"),
        ("height", "height_mm", "strength", "strength {:g}"),
    ):
        curves: dict[str, list[Row]] = {}
        for row in sorted(tables["conditions"], key=lambda row: (row[other], row[key])):
            curves.setdefault(label.format(row[other]), []).append(row)
        if curves := {label: rows for label, rows in curves.items() if len(rows) > 2}:
            figures[name] = curve_figure(curves, key, published=PUBLISHED)
    return figures


def _trials(results: SweepResults) -> list[Row]:
    """One row per trial with results; frames with E of exactly 0, which have nothing to play, do not count."""
    rows: list[Row] = []
    for number, trial in enumerate(results.settings["trials"]):
        plays = results.error[number] > 0
        error, rounded = results.error[number, plays], results.rounded_error[number, plays]
        if np.isfinite(results.error[number]).any():
            where = {"recording": trial["recording"], "variant": trial["variant"], "frames": int(plays.sum())}
            spread = _spread(error, rounded) if plays.any() else _spread(np.zeros(1), np.zeros(1))
            rows.append(where | {"strength": float(results.strength[number])} | spread)
    return rows
