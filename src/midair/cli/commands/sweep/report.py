"""The command `sweep report`: tables and figures of a sweep."""

from pathlib import Path

from midair.cli.commands.sweep.output import show_patterns, show_trials
from midair.cli.console import out, print_json
from midair.cli.options import Json
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
    """Write tables (CSV) and figures (PNG) of a sweep, finished or not.

    Patterns: histogram of E, examples, E over strength and height. Recordings: distribution of E in each trial.

    Parameters
    ----------
    source
        NAME.zarr, or an address that fsspec can open.
    output
        Output folder. [default: NAME.report, in the current folder for a remote sweep]

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
