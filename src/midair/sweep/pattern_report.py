"""Reports of sweeps over patterns and over recordings: tables in CSV, figures in PNG."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.datasets import channel_amplitudes
from midair.errors import InputError
from midair.figures import (
    Curve,
    ErrorSpread,
    Example,
    curve_figure,
    examples_figure,
    histogram_figure,
    png_bytes,
    trials_figure,
)
from midair.files import csv_text, write_file
from midair.progress import report_progress
from midair.sweep.pattern_sweep import Condition, PatternSweep, problem_of, solve_patterns
from midair.sweep.store import SweepResults, store_errors_raised

Row = dict[str, Any]

PUBLISHED = (0.05, 0.15)
"""Range of the average error that the paper reports for these patterns (5.1)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternReport:
    """Figures of a sweep over patterns."""

    conditions: tuple[Row, ...]
    """Distribution of E over the patterns, with and without phase rounding, for each strength and height."""
    channels: tuple[Row, ...]
    """The same for each number of active channels, for conditions with all patterns."""
    words: str
    """Progress and cost of the sweep."""

    def plain(self) -> Row:
        """Values for JSON."""
        return {"simulated": True} | asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatternResults:
    """Results of a sweep over patterns, which may be incomplete."""

    sweep: PatternSweep
    patterns: NDArray[np.int64]
    """Bit k is channel k, shape (pattern,)."""
    error: Array
    """Shape (condition, pattern); NaN where it is not computed."""
    rounded_error: Array
    """Same shape, for rounded phases."""
    seconds: float
    """Processor time of all finished tasks."""

    @classmethod
    @store_errors_raised()
    def of(cls, results: SweepResults) -> "PatternResults":
        """Create the results from those of a store; raise an InputError for a sweep over something else."""
        if results.kind != "patterns":
            raise InputError(f"sweep: expected one over patterns, got one over {results.kind}")
        return cls(
            sweep=PatternSweep.of_settings(results.settings),
            patterns=results.coordinates["pattern"],
            error=results.error,
            rounded_error=results.rounded_error,
            seconds=results.seconds,
        )

    @property
    def known(self) -> int:
        """Number of solved patterns over all conditions."""
        return int(np.isfinite(self.error).sum())

    @property
    def asked(self) -> int:
        """Number of patterns of the sweep over all conditions."""
        return sum(condition.count for condition in self.sweep.conditions())


@store_errors_raised()
def report_of(results: PatternResults) -> PatternReport:
    """Compute the figures of a sweep that may be incomplete; raise an InputError if no pattern is solved yet."""
    if not _main(results):
        raise InputError("sweep: expected solved patterns, got none so far; continue with midair sweep patterns")
    return PatternReport(
        conditions=tuple(_rows(results)),
        channels=tuple(row for number in _main(results) for row in _by_channels(results, number)),
        words=f"{results.known} of {results.asked} patterns solved, {results.seconds:.0f} s of processor time, "
        f"{1e3 * results.seconds / results.known:.2f} ms a pattern.",
    )


def write_sweep_report(results: PatternResults, folder: Path) -> list[Path]:
    """Write tables and figures into a folder, which is created if necessary; return the paths.

    The files are conditions.csv, channels.csv, histogram.csv, histogram.png and examples.png; also strength.png and
    height.png if the sweep has curves.
    """
    report = report_of(results)
    tables = {"conditions": report.conditions, "channels": report.channels, "histogram": _histogram(results)}
    texts = {f"{name}.csv": csv_text(rows) for name, rows in tables.items()}
    return _write(folder, texts | _figures(results))


def _write(folder: Path, content: Mapping[str, str | bytes]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in content.items():
        write_file(folder / name, data)
    return [folder / name for name in content]


def examples_of(
    results: PatternResults, number: int, *, quantiles: Sequence[float] = (0, 0.25, 0.5, 0.75, 1)
) -> list[Example]:
    """Select patterns of one condition at quantiles of E, and compute their fields.

    A sweep stores errors, not phases, so the task of each pattern is solved again.
    """
    sweep, error = results.sweep, results.error[number]
    condition = sweep.conditions()[number]
    solved = np.flatnonzero(np.isfinite(error))
    # A stable sort gives the same examples each time, also for equal errors.
    order = solved[np.argsort(error[solved], kind="stable")]
    chosen = [int(order[round(share * (len(order) - 1))]) for share in quantiles]
    return [_example(sweep, condition, results.patterns, place) for place in chosen]


def _example(sweep: PatternSweep, condition: Condition, patterns: NDArray[np.int64], place: int) -> Example:
    # Solve the whole task, because a method may treat the patterns of a batch together.
    first = place - place % sweep.chunk
    some = patterns[first : min(first + sweep.chunk, condition.count)]
    solved, problem = solve_patterns(sweep, condition, some), problem_of(sweep, condition, some)
    row = place - first
    return Example(
        name=f"{some[row]:#06x}",
        error=float(solved.error[row]),
        target=problem.amplitude[row],
        field=solved.level[row] * np.abs(problem.field(solved.phase[row])),
    )


def _main(results: PatternResults) -> list[int]:
    """Conditions with all patterns of the sweep, of which some are solved."""
    sweep = results.sweep
    return [
        number
        for number, one in enumerate(sweep.conditions())
        if one.strength in sweep.strengths and one.height in sweep.heights and np.isfinite(results.error[number]).any()
    ]


def _rows(results: PatternResults, first: int | None = None) -> list[Row]:
    """One row per condition from the `first` patterns or all, by height and strength."""
    known = np.isfinite(results.error[:, :first]).any(axis=1)
    rows = [_condition(results, int(number), first) for number in np.flatnonzero(known)]
    return sorted(rows, key=lambda row: (row["height_mm"], row["strength"]))


def _condition(results: PatternResults, number: int, first: int | None) -> Row:
    condition = results.sweep.conditions()[number]
    known = np.flatnonzero(np.isfinite(results.error[number, :first]))
    error, rounded = results.error[number, known], results.rounded_error[number, known]
    low, high = PUBLISHED
    return {
        "strength": condition.strength,
        "height_mm": round(1e3 * condition.height, 6),
        "patterns": len(known),
        **_spread(error),
        "worst_pattern": f"{results.patterns[known][error.argmax()]:#06x}",
        "share_5_to_15": float(np.mean((error >= low) & (error <= high))),
        "mean_rounded": float(rounded.mean()),
        "worst_rounded": float(rounded.max()),
    }


def _by_channels(results: PatternResults, number: int) -> list[Row]:
    condition = results.sweep.conditions()[number]
    loud = channel_amplitudes(results.patterns, results.sweep.sensor).sum(axis=1).astype(int)
    rows: list[Row] = []
    for count in range(1, results.sweep.sensor.count + 1):
        error = results.error[number, loud == count]
        error = error[np.isfinite(error)]
        if len(error):
            where = {"strength": condition.strength, "height_mm": round(1e3 * condition.height, 6)}
            rows.append(where | {"channels": count, "patterns": len(error), **_spread(error)})
    return rows


def _spread(error: Array) -> Row:
    low, middle, high = np.percentile(error, [5, 50, 95])
    spread = float(error.std(ddof=1)) if len(error) > 1 else 0.0
    return {
        "mean": float(error.mean()),
        "sd": spread,
        "p5": float(low),
        "median": float(middle),
        "p95": float(high),
        "worst": float(error.max()),
    }


def _histogram(results: PatternResults, *, width: float = 0.005) -> list[Row]:
    """Number of patterns in each bin of E, with a column for each main condition."""
    numbers, conditions = _main(results), results.sweep.conditions()
    top = max(float(np.nanmax(results.error[number])) for number in numbers)
    edges = width * np.arange(int(top / width) + 2)
    rows: list[Row] = [{"E_from": round(float(edge), 6)} for edge in edges[:-1]]
    for number in numbers:
        error = results.error[number]
        counts = np.histogram(error[np.isfinite(error)], edges)[0]
        for row, count in zip(rows, counts, strict=True):
            row[f"strength_{conditions[number].strength:g}_at_{1e3 * conditions[number].height:g}mm"] = int(count)
    return rows


def _figures(results: PatternResults) -> dict[str, bytes]:
    conditions, numbers = results.sweep.conditions(), _main(results)
    labels = [f"strength {conditions[n].strength:g}, {1e3 * conditions[n].height:g} mm" for n in numbers]
    errors = [results.error[number][np.isfinite(results.error[number])] for number in numbers]
    sweep, one = results.sweep, conditions[numbers[0]]
    made = {
        "histogram.png": histogram_figure(list(zip(labels, errors, strict=True)), published=PUBLISHED),
        "examples.png": examples_figure(
            examples_of(results, numbers[0]), sweep.grid(one.height), sweep.sensor, title=labels[0]
        ),
    }
    along = _rows(results, sweep.curve_count)  # the same patterns at every point of a curve
    for name, label, key, other in (
        ("strength.png", "strength (of a single focus)", "strength", "height_mm"),
        ("height.png", "height (mm)", "height_mm", "strength"),
    ):
        curves = _curves(along, key, other)
        if curves:
            made[name] = curve_figure(curves, quantity=label, published=PUBLISHED)
    return {name: png_bytes(figure) for name, figure in report_progress(made.items(), len(made))}


def _curves(rows: Sequence[Row], key: str, other: str) -> list[Curve]:
    """E over strength or height, with a curve for each value of the other one that has three points or more."""
    spell: Callable[[float], str] = (lambda value: f"{value:g} mm") if other == "height_mm" else "strength {:g}".format
    curves: list[Curve] = []
    for value in sorted({row[other] for row in rows}):
        along = sorted((row for row in rows if row[other] == value), key=lambda row: row[key])
        if len(along) >= 3:
            x, mean, low, high = (np.array([row[name] for row in along]) for name in (key, "mean", "p5", "p95"))
            curves.append(Curve(name=spell(value), x=x, mean=mean, low=low, high=high))
    return curves


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
    return _write(folder, {"trials.csv": csv_text(report.rows), "trials.png": png_bytes(trials_figure(spreads))})


def _row(results: SweepResults, number: int, trial: dict[str, Any]) -> Row:
    there = np.isfinite(results.error[number])
    known = results.error[number][there]
    if not len(known):
        return {}
    # E is 0 by definition for a silent target, and never exactly 0 otherwise.
    plays = known > 0
    error = known[plays] if plays.any() else np.zeros(1)
    rounded = results.rounded_error[number][there][plays] if plays.any() else np.zeros(1)
    spread = _spread(error)
    return {
        "recording": trial["recording"],
        "variant": trial["variant"],
        "frames": int(plays.sum()),
        "strength": float(np.nanmax(results.strength[number])),
        **{name: spread[name] for name in ("mean", "p5", "p95", "worst")},
        "mean_rounded": float(rounded.mean()),
        "worst_rounded": float(rounded.max()),
    }
