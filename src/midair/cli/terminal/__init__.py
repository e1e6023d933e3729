"""What commands share: options, quantities, what is printed, keys and meters."""

from midair.cli.terminal.air_options import AirOptions, say_air
from midair.cli.terminal.bringing import FileOptions, bring, parse_names, parsed
from midair.cli.terminal.calibration_output import (
    OutputOptions,
    array_rows,
    as_measured,
    given_calibration,
    prepare_page,
    tell,
)
from midair.cli.terminal.comparisons import card_of, plain, print_card, print_palm
from midair.cli.terminal.console import (
    PlainConsole,
    Talk,
    banner,
    err,
    flags_of,
    out,
    print_figures,
    print_json,
    print_rows,
    say,
    stages,
    talk,
    talking,
)
from midair.cli.terminal.exposure_options import ExposureOptions, say_how_long, say_how_long_to_come
from midair.cli.terminal.keeping import as_recording, keep, may_write, say_kept
from midair.cli.terminal.keys import Keys, Signals, signals_noted
from midair.cli.terminal.meter_screen import MeterScreen
from midair.cli.terminal.nominal import nominal_calibration, stated_sensitivity
from midair.cli.terminal.offering import GROUPS, epilogue, examples_of, offer
from midair.cli.terminal.options import BandOptions, Force, Frequency, Json, Length, Quiet, SolveOptions, Time
from midair.cli.terminal.originals import brought_together, felt_part, kept_aside, made_with
from midair.cli.terminal.play_options import PlayOptions, play_on_array, say_room
from midair.cli.terminal.quantities import parse_quantity, quantity, spell
from midair.cli.terminal.rows import (
    calibrated_by,
    calibration_figures,
    level_of_file,
    level_rows,
    recording_figures,
    recording_rows,
    warn_level,
)
from midair.cli.terminal.stage_options import Drawing, StageOptions, stroke_rows, strokes_of
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
    "Talk",
    "Time",
    "as_recording",
    "banner",
    "brought_together",
    "bring",
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
    "keep",
    "made_with",
    "level_of_file",
    "level_rows",
    "warn_level",
    "may_write",
    "nominal_calibration",
    "offer",
    "out",
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
    "quantity",
    "recording_figures",
    "recording_rows",
    "say",
    "say_how_long",
    "say_how_long_to_come",
    "say_air",
    "say_kept",
    "say_room",
    "show_patterns",
    "show_trials",
    "signals_noted",
    "spell",
    "stages",
    "stated_sensitivity",
    "stroke_rows",
    "strokes_of",
    "swept",
    "take_rows",
    "talk",
    "talking",
    "tell",
]
