"""`midair sweep report`: what came out of a sweep of either kind."""

from pathlib import Path

from midair.cli.commands.sweep.patterns import app, show_patterns
from midair.cli.commands.sweep.recordings import show_trials
from midair.cli.terminal.console import out, print_json
from midair.sweep.pattern_report import PatternResults, report_of, write_sweep_report
from midair.sweep.store import load_sweep
from midair.sweep.trial_report import TrialReport, trial_report, write_trial_report


@app.command(name="report")
def report_command(source: Path, /, *, output: Path | None = None, json: bool = False) -> None:
    """Tables (CSV) and figures (PNG) of a sweep, finished or not.

    Of patterns: histogram of E, examples, E over strength and height. Of recordings: how E is spread in each trial.

    Parameters
    ----------
    source
        NAME.zarr.
    output
        Folder for the files; NAME.report if not given.
    json
        Print JSON for a program.
    """
    folder, results = output or source.with_suffix(".report"), load_sweep(source)
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
    out().print("\n".join(str(file) for file in files), markup=False)
    return None
