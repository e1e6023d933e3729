"""`midair sweep report`: what came out of a sweep of either kind."""

from pathlib import Path

from midair.cli.terminal import Json, out, print_json, show_patterns, show_trials
from midair.sweep import (
    PatternResults,
    TrialReport,
    load_sweep,
    report_of,
    trial_report,
    write_sweep_report,
    write_trial_report,
)


def report_command(source: str, /, *, output: Path | None = None, json: Json = False) -> None:
    """Tables (CSV) and figures (PNG) of a sweep, finished or not.

    Of patterns: histogram of E, examples, E over strength and height. Of recordings: how E is spread in each trial.

    Parameters
    ----------
    source
        NAME.zarr; also an address that fsspec knows.
    output
        Folder for the files; NAME.report if not given, here if the sweep is elsewhere.

    Examples
    --------
    $ midair sweep report patterns.zarr
    """
    here = Path(source.rpartition("/")[2] if "://" in source else source)
    folder, results = output or here.with_suffix(".report"), load_sweep(source)
    if results.kind == "recordings":
        report, files = trial_report(results), write_trial_report(results, folder)
    else:
        known = PatternResults.of(results)
        report, files = report_of(known), write_sweep_report(known, folder)
    if json:
        return print_json(report.plain() | {"files": [str(file) for file in files]})
    if isinstance(report, TrialReport):
        show_trials(report)
    else:
        show_patterns(report)
    out().print("\n".join(str(file) for file in files))
    return None
