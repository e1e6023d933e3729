"""Shared code of the commands: options, quantities, output, keys and meters.

Each module is imported on first use, so that the help needs none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from midair.cli.speeds import Work, workload_of
    from midair.cli.terminal.air_options import AirOptions, say_air
    from midair.cli.terminal.calibration_output import (
        OutputOptions,
        array_rows,
        as_measured,
        given_calibration,
        prepare_page,
        tell,
    )
    from midair.cli.terminal.compare_inputs import felt_part, kept_aside, made_with
    from midair.cli.terminal.comparisons import card_of, plain, print_card, print_palm, print_side_by_side
    from midair.cli.terminal.console import (
        PlainConsole,
        ProgressBars,
        Verbosity,
        banner,
        busy_bar,
        err,
        flags_of,
        out,
        print_figures,
        print_json,
        print_rows,
        progress_bars,
        say,
        verbosity,
        warn_simulated,
        with_verbosity,
        work_of,
    )
    from midair.cli.terminal.exposure_options import ExposureOptions, say_how_long, say_how_long_to_come
    from midair.cli.terminal.help_text import GROUPS, epilogue, examples_of, imported, offer
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
        paper_beside,
        way_of,
    )
    from midair.cli.terminal.output import as_recording, may_write, print_written, write_recording
    from midair.cli.terminal.play_options import PlayOptions, play_on_array, say_room
    from midair.cli.terminal.quantities import parse_quantity, quantity, spell
    from midair.cli.terminal.rows import (
        calibrated_by,
        calibration_figures,
        level_of_file,
        level_rows,
        met_of,
        recording_figures,
        recording_rows,
        warn_level,
    )
    from midair.cli.terminal.stage_options import Drawing, StageOptions, stroke_rows, strokes_of
    from midair.cli.terminal.stated_calibration import calibration_from_options, scale_by, stated_sensitivity
    from midair.cli.terminal.sweep_output import show_patterns, show_trials, swept
    from midair.cli.terminal.take_output import plain_take, take_rows

__all__ = [
    "array_rows",
    "as_measured",
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
    "calibrated_by",
    "calibration_figures",
    "card_of",
    "epilogue",
    "err",
    "examples_of",
    "felt_part",
    "flags_of",
    "kept_aside",
    "given_calibration",
    "imported",
    "write_recording",
    "made_with",
    "level_of_file",
    "level_rows",
    "warn_level",
    "may_write",
    "met_of",
    "calibration_from_options",
    "offer",
    "out",
    "paper_beside",
    "parse_names",
    "parse_quantity",
    "parsed",
    "plain",
    "plain_take",
    "play_on_array",
    "prepare_page",
    "print_card",
    "print_figures",
    "print_json",
    "print_palm",
    "print_rows",
    "print_side_by_side",
    "quantity",
    "recording_figures",
    "recording_rows",
    "say",
    "say_how_long",
    "say_how_long_to_come",
    "say_air",
    "print_written",
    "say_room",
    "scale_by",
    "show_patterns",
    "show_trials",
    "busy_bar",
    "signals_noted",
    "spell",
    "progress_bars",
    "stated_sensitivity",
    "stroke_rows",
    "strokes_of",
    "swept",
    "take_rows",
    "verbosity",
    "with_verbosity",
    "tell",
    "way_of",
    "work_of",
    "workload_of",
    "warn_simulated",
]

_FROM = {
    "midair.cli.speeds": "Work workload_of",
    "midair.cli.terminal.air_options": "AirOptions say_air",
    "midair.cli.terminal.import_options": "FileOptions import_recording parse_names parsed",
    "midair.cli.terminal.calibration_output": (
        "OutputOptions array_rows as_measured given_calibration prepare_page tell"
    ),
    "midair.cli.terminal.comparisons": "card_of plain print_card print_palm print_side_by_side",
    "midair.cli.terminal.console": (
        "PlainConsole ProgressBars Verbosity banner err flags_of out print_figures print_json print_rows say busy_bar "
        "progress_bars verbosity with_verbosity warn_simulated work_of"
    ),
    "midair.cli.terminal.exposure_options": "ExposureOptions say_how_long say_how_long_to_come",
    "midair.cli.terminal.output": "as_recording write_recording may_write print_written",
    "midair.cli.terminal.keys": "Keys Signals signals_noted",
    "midair.cli.terminal.meter_screen": "MeterScreen",
    "midair.cli.terminal.stated_calibration": "calibration_from_options scale_by stated_sensitivity",
    "midair.cli.terminal.help_text": "GROUPS epilogue examples_of imported offer",
    "midair.cli.terminal.options": (
        "BandOptions Force Frequency Json Length Quiet SolveOptions Time paper_beside way_of"
    ),
    "midair.cli.terminal.compare_inputs": "felt_part kept_aside made_with",
    "midair.cli.terminal.play_options": "PlayOptions play_on_array say_room",
    "midair.cli.terminal.quantities": "parse_quantity quantity spell",
    "midair.cli.terminal.rows": (
        "calibrated_by calibration_figures level_of_file level_rows met_of recording_figures recording_rows warn_level"
    ),
    "midair.cli.terminal.stage_options": "Drawing StageOptions stroke_rows strokes_of",
    "midair.cli.terminal.sweep_output": "show_patterns show_trials swept",
    "midair.cli.terminal.take_output": "plain_take take_rows",
}
"""Names of this package, by the module that defines them."""

_ELSEWHERE = {name: module for module, names in _FROM.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _ELSEWHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Cached, so that later look-ups do not call this function.
    value = globals()[name] = getattr(import_module(_ELSEWHERE[name]), name)
    return value
