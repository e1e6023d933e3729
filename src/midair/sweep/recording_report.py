"""Report of a sweep over recordings: a table of trials in CSV, a figure in PNG."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.figures import ErrorSpread, png_bytes, trials_figure
from midair.files import atomic_file, csv_text
from midair.sweep.store import SweepResults, store_errors_raised

Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialReport:
    """Figures of a sweep over recordings."""

    rows: tuple[Row, ...]
    """One row per trial with results."""
    words: str
    """Progress and cost of the sweep."""

    def plain(self) -> Row:
        """Values for JSON."""
        return {"simulated": True, "trials": list(self.rows), "words": self.words}


@store_errors_raised()
def trial_report(results: SweepResults) -> TrialReport:
    """Compute the figures of a sweep over recordings that may be incomplete; silent frames do not count.

    Raises an InputError for a sweep over something else, or if nothing is solved yet.
    """
    if results.kind != "recordings":
        raise InputError(f"sweep: expected one over recordings, got one over {results.kind}")
    rows = tuple(_row(results, number, trial) for number, trial in enumerate(results.settings["trials"]))
    done = tuple(row for row in rows if row)
    if not done:
        raise InputError("sweep: expected solved recordings, got none so far; continue with midair sweep recordings")
    frames = sum(row["frames"] for row in done)
    known = np.isfinite(results.error).sum(axis=1)
    whole = sum(count == trial["frames"] for count, trial in zip(known, results.settings["trials"], strict=True))
    partly = f", {len(done) - whole} in part" if len(done) > whole else ""
    words = (
        f"{whole} of {len(rows)} trials solved{partly}, {frames} frames with something to play, "
        f"{results.seconds:.0f} s of processor time, {1e3 * results.seconds / max(frames, 1):.2f} ms a frame."
    )
    return TrialReport(rows=done, words=words)


def write_trial_report(results: SweepResults, folder: Path) -> list[Path]:
    """Write trials.csv and trials.png into a folder, which is created if necessary; return the paths."""
    report = trial_report(results)
    spreads = [
        ErrorSpread(
            name=f"{row['recording']} {row['variant']}".strip(),
            low=row["p5"],
            middle=row["mean"],
            high=row["p95"],
            worst=row["worst"],
            strength=row["strength"],
        )
        for row in report.rows
    ]
    folder.mkdir(parents=True, exist_ok=True)
    content = {"trials.csv": csv_text(report.rows).encode(), "trials.png": png_bytes(trials_figure(spreads))}
    for name, data in content.items():
        with atomic_file(folder / name) as partial:
            partial.write_bytes(data)
    return [folder / name for name in content]


def _row(results: SweepResults, number: int, trial: dict[str, Any]) -> Row:
    there = np.isfinite(results.error[number])
    known = results.error[number][there]
    if not len(known):
        return {}
    # E is 0 by definition for a silent target, and never exactly 0 otherwise.
    plays = known > 0
    error = known[plays] if plays.any() else np.zeros(1)
    rounded = results.rounded_error[number][there][plays] if plays.any() else np.zeros(1)
    low, high = np.percentile(error, [5, 95])
    return {
        "recording": trial["recording"],
        "variant": trial["variant"],
        "frames": int(plays.sum()),
        "strength": float(np.nanmax(results.strength[number])),
        "mean": float(error.mean()),
        "p5": float(low),
        "p95": float(high),
        "worst": float(error.max()),
        "mean_rounded": float(rounded.mean()),
        "worst_rounded": float(rounded.max()),
    }
