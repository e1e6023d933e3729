"""All commands by name, one module each; a module is imported only when its command or its help is called.

The summaries stand here so that `midair --help` imports no command; a test compares them with the docstrings.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module

from cyclopts import App

from midair.cli.help_text import app_of_command

COMMANDS: Mapping[str, tuple[str, str, str]] = {
    "demo": (
        "Get started",
        "demo:demo_command",
        "Record a virtual towel stroke, reproduce it in the best mode and in the paper's, and write a report.",
    ),
    "studio": (
        "Get started",
        "studio:studio_command",
        "Open the studio in the browser: record, solve, play and compare.",
    ),
    "doctor": (
        "Get started",
        "doctor:doctor_command",
        "Check the installation, drivers and devices, and print advice for each problem.",
    ),
    "record": ("Record", "record:record_command", "Record a sensor to a file."),
    "import": ("Record", "import_export:import_command", "Convert a file of another program to a recording."),
    "mend": (
        "Record",
        "import_export:mend_command",
        "Convert a file with gaps (NaN, infinite or empty values) to a recording and fill the gaps.",
    ),
    "identify": (
        "Record",
        "identify:identify_command",
        "Find out which channel belongs to which cell, by taps or tones.",
    ),
    "repair": (
        "Record",
        "import_export:repair_command",
        "Repair an interrupted or damaged recording or drive.",
    ),
    "info": (
        "Edit",
        "info:info_command",
        "Print the contents, origin and history of a recording, a drive or a calibration.",
    ),
    "show": (
        "Edit",
        "show:show_command",
        "Show a recording, a drive or a comparison as a web page, a film or a sound file.",
    ),
    "cut": ("Edit", "edit:cut_command", "Extract a part of a recording."),
    "trim": ("Edit", "edit:trim_command", "Remove silence from both ends of a recording."),
    "join": ("Edit", "edit:join_command", "Join recordings of the same sensor end to end."),
    "gain": ("Edit", "edit:gain_command", "Multiply a recording by a factor or a level in decibels."),
    "mask": (
        "Edit",
        "edit:mask_command",
        "Set channels of a recording to zero, or interpolate them from their neighbours.",
    ),
    "resample": ("Edit", "edit:resample_command", "Change the frame rate of a recording."),
    "export": ("Edit", "import_export:export_command", "Convert a recording to another file format."),
    "solve": ("Reproduce", "solve_play:solve_command", "Compute transducer phases that reproduce a recording."),
    "exposure": (
        "Reproduce",
        "exposure:exposure_command",
        "Compute the sound levels of a drive at ears and palm, and check them against limits.",
    ),
    "play": (
        "Reproduce",
        "solve_play:play_command",
        "Play a drive on an array; on the virtual array, re-record the pressure.",
    ),
    "stop": ("Reproduce", "stop:stop_command", "Silence all arrays that midair plays on."),
    "live": ("Reproduce", "live:live_command", "Play the pressure on a sensor in real time, 13 ms later."),
    "loop": (
        "Reproduce",
        "loop:loop_command",
        "Solve, play, re-record, correct and compare a recording, and write a report.",
    ),
    "compare": (
        "Evaluate",
        "compare:compare_command",
        "Compare a re-recording or a drive with its original recording.",
    ),
    "budget": (
        "Evaluate",
        "budget:budget_command",
        "Compute how much each stage of a virtual reproduction distorts: mapping, solver, hold, transducers, sensor.",
    ),
    "paper": (
        "Research",
        "paper:paper_command",
        "Reproduce the paper's figures and numbers on a virtual rig, in the paper's mode and in the best mode.",
    ),
}
"""For each command: its group in `help_text.GROUPS`, its "module:function", and the first line of its help."""

FOLDERS: Mapping[str, tuple[str, str]] = {
    "calibrate": (
        "Calibrate",
        "Convert a recording to pressure (midair calibrate RECORDING), or measure a calibration with a subcommand.",
    ),
    "sweep": ("Research", "Solve many targets in parallel processes and report the error E."),
    "study": ("Research", "Plan, run and analyse a user study."),
}
"""Commands with subcommands: group and help."""

PASSES: Mapping[str, int] = {
    "import": 4,
    "mend": 4,
    "repair": 6,
    "info": 2,
    "show": 3,
    "cut": 5,
    "trim": 8,
    "join": 7,
    "gain": 5,
    "mask": 5,
    "resample": 5,
    "export": 2,
    "exposure": 3,
    "compare": 10,
    "doctor": 1,
    "calibrate": 8,
    "calibrate measure": 1,
    "calibrate tone": 1,
    "study plan": 1,
    "study power": 1,
    "study paper": 1,
    "study analyse": 1,
    "sweep report": 1,
}
"""For commands without their own progress bar: how many times they go through their data, which `busy_bar` needs."""


def command_of(tokens: Sequence[str]) -> str:
    """Key of `PASSES` that a command line names, such as "cut" or "calibrate measure"; "" if none."""
    return next((name for name in (" ".join(tokens[:2]), *tokens[:1]) if name in PASSES), "")


def __getattr__(name: str) -> App:
    """Import a command and return its app, for names such as `solve_app`."""
    typed = name.removesuffix("_app")
    if typed == name or typed not in COMMANDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, command = COMMANDS[typed][1].partition(":")
    return app_of_command(getattr(import_module(f"{__name__}.{module}"), command), typed)
