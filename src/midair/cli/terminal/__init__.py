"""Shared code of the commands: options, quantities, output, keys and meters.

Each module is app_of_command on first use, so that the help needs none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from midair.cli.terminal.air_options import AirOptions, print_air
    from midair.cli.terminal.calibration_output import (
        OutputOptions,
        array_rows,
        prepare_page,
        print_calibration,
        require_calibration,
        with_array_calibration,
    )
    from midair.cli.terminal.compare_inputs import cached_pressure, calibrated_part, settings_of_rerecording
    from midair.cli.terminal.comparisons import metrics_or_none, plain, print_metrics, print_palm, print_side_by_side
    from midair.cli.terminal.console import (
        PlainConsole,
        ProgressBars,
        Verbosity,
        banner,
        busy_bar,
        err,
        out,
        parse_flags,
        print_figures,
        print_json,
        print_line,
        print_rows,
        progress_bars,
        verbosity,
        warn_simulated,
        with_verbosity,
        work_of,
    )
    from midair.cli.terminal.exposure_options import ExposureOptions, print_check_time, print_check_time_ahead
    from midair.cli.terminal.help_text import GROUPS, add_command, app_of_command, epilogue, examples_of
    from midair.cli.terminal.import_options import FileOptions, import_recording, parse_names, parsed
    from midair.cli.terminal.keys import Keys, Signals, signals_noted
    from midair.cli.terminal.meter_screen import MeterScreen
    from midair.cli.terminal.options import (
        BandOptions,
        Force,
        Frequency,
        Json,
        Length,
        Quiet,
        SolveOptions,
        Time,
        mode_name,
        paper_options,
    )
    from midair.cli.terminal.output import as_recording, may_write, print_written, write_recording
    from midair.cli.terminal.play_options import HeatOptions, PlayOptions, play_on_array, print_room_air
    from midair.cli.terminal.quantities import format_quantity, parse_quantity, quantity
    from midair.cli.terminal.rows import (
        calibration_figures,
        calibration_text,
        level_of_file,
        level_rows,
        recording_figures,
        recording_rows,
        solve_error,
        warn_level,
    )
    from midair.cli.terminal.stage_options import Drawing, StageOptions, recorded_strokes, stroke_rows
    from midair.cli.terminal.stated_calibration import calibration_from_options, scale_by, stated_sensitivity
    from midair.cli.terminal.sweep_output import run_with_bar, show_patterns, show_trials
    from midair.cli.terminal.take_output import take_rows, take_values
    from midair.cli.time_estimates import Work, workload_of

__all__ = [
    "array_rows",
    "with_array_calibration",
    "AirOptions",
    "BandOptions",
    "Drawing",
    "ExposureOptions",
    "FileOptions",
    "Force",
    "Frequency",
    "GROUPS",
    "Json",
    "Keys",
    "Length",
    "MeterScreen",
    "OutputOptions",
    "PlainConsole",
    "HeatOptions",
    "PlayOptions",
    "Quiet",
    "Signals",
    "SolveOptions",
    "StageOptions",
    "ProgressBars",
    "Verbosity",
    "Work",
    "Time",
    "as_recording",
    "banner",
    "import_recording",
    "calibration_text",
    "calibration_figures",
    "metrics_or_none",
    "epilogue",
    "err",
    "examples_of",
    "calibrated_part",
    "parse_flags",
    "cached_pressure",
    "require_calibration",
    "app_of_command",
    "write_recording",
    "settings_of_rerecording",
    "level_of_file",
    "level_rows",
    "warn_level",
    "may_write",
    "solve_error",
    "calibration_from_options",
    "add_command",
    "out",
    "paper_options",
    "parse_names",
    "parse_quantity",
    "parsed",
    "plain",
    "take_values",
    "play_on_array",
    "prepare_page",
    "print_metrics",
    "print_figures",
    "print_json",
    "print_palm",
    "print_rows",
    "print_side_by_side",
    "quantity",
    "recording_figures",
    "recording_rows",
    "print_line",
    "print_check_time",
    "print_check_time_ahead",
    "print_air",
    "print_written",
    "print_room_air",
    "scale_by",
    "show_patterns",
    "show_trials",
    "busy_bar",
    "signals_noted",
    "format_quantity",
    "progress_bars",
    "stated_sensitivity",
    "stroke_rows",
    "recorded_strokes",
    "run_with_bar",
    "take_rows",
    "verbosity",
    "with_verbosity",
    "print_calibration",
    "mode_name",
    "work_of",
    "workload_of",
    "warn_simulated",
]

_FROM = {
    "midair.cli.time_estimates": "Work workload_of",
    "midair.cli.terminal.air_options": "AirOptions print_air",
    "midair.cli.terminal.import_options": "FileOptions import_recording parse_names parsed",
    "midair.cli.terminal.calibration_output": (
        "OutputOptions array_rows with_array_calibration require_calibration prepare_page print_calibration"
    ),
    "midair.cli.terminal.comparisons": "metrics_or_none plain print_metrics print_palm print_side_by_side",
    "midair.cli.terminal.console": (
        "PlainConsole ProgressBars Verbosity banner err parse_flags out print_figures print_json print_rows print_line "
        "busy_bar progress_bars verbosity with_verbosity warn_simulated work_of"
    ),
    "midair.cli.terminal.exposure_options": "ExposureOptions print_check_time print_check_time_ahead",
    "midair.cli.terminal.output": "as_recording write_recording may_write print_written",
    "midair.cli.terminal.keys": "Keys Signals signals_noted",
    "midair.cli.terminal.meter_screen": "MeterScreen",
    "midair.cli.terminal.stated_calibration": "calibration_from_options scale_by stated_sensitivity",
    "midair.cli.terminal.help_text": "GROUPS epilogue examples_of app_of_command add_command",
    "midair.cli.terminal.options": (
        "BandOptions Force Frequency Json Length Quiet SolveOptions Time paper_options mode_name"
    ),
    "midair.cli.terminal.compare_inputs": "calibrated_part cached_pressure settings_of_rerecording",
    "midair.cli.terminal.play_options": "HeatOptions PlayOptions play_on_array print_room_air",
    "midair.cli.terminal.quantities": "parse_quantity quantity format_quantity",
    "midair.cli.terminal.rows": (
        "calibration_text calibration_figures level_of_file level_rows solve_error recording_figures recording_rows "
        "warn_level"
    ),
    "midair.cli.terminal.stage_options": "Drawing StageOptions stroke_rows recorded_strokes",
    "midair.cli.terminal.sweep_output": "show_patterns show_trials run_with_bar",
    "midair.cli.terminal.take_output": "take_values take_rows",
}
"""Names of this package, by the module that defines them."""

_ELSEWHERE = {name: module for module, names in _FROM.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _ELSEWHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Cached, so that later look-ups do not call this function.
    value = globals()[name] = getattr(import_module(_ELSEWHERE[name]), name)
    return value
