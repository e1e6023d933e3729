"""The commands, a file each; none imports another. `COMMANDS` has them by the names that people type.

None is imported before somebody calls it or asks for its help: each takes what it needs with it, NumPy at the least.
What the help of all says of it is said here, and a test holds it against the command's own words.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module

from cyclopts import App

from midair.cli.terminal import imported

COMMANDS: Mapping[str, tuple[str, str, str]] = {
    "demo": (
        "Begin",
        "demo:demo_command",
        "Record a virtual towel stroke, reproduce it on a virtual array in the best mode and in the paper's, "
        "and report.",
    ),
    "studio": (
        "Begin",
        "studio:studio_command",
        "Open the studio: record, solve, play and compare in the browser, with every frame to be seen.",
    ),
    "doctor": (
        "Begin",
        "doctor:doctor_command",
        "Look at what is installed and what works here, and say what to do about what does not.",
    ),
    "record": ("Record", "record:record_command", "Record a sensor into a file, which is written as the frames come."),
    "import": (
        "Record",
        "import_export:import_command",
        "Bring a file of any program into a recording, and say what was assumed.",
    ),
    "mend": (
        "Record",
        "import_export:mend_command",
        "Bring a file with gaps into a recording: NaN, infinite or empty numbers are filled, and the "
        "recording says where.",
    ),
    "identify": (
        "Record",
        "identify:identify_command",
        "Find out which channel is which cell: tap each cell when its turn comes, row by row from the top left.",
    ),
    "repair": (
        "Record",
        "import_export:repair_command",
        "Close a recording whose program was killed, so that any program can open it.",
    ),
    "info": (
        "Edit",
        "info:info_command",
        "Say what a recording, a drive or a calibration holds, where it came from, and what was done to it.",
    ),
    "show": (
        "Edit",
        "show:show_command",
        "Show a recording, a drive, or a re-recording over its original: as a page, a film in slow motion, or a sound.",
    ),
    "cut": ("Edit", "edit:cut_command", "Keep a part of a recording."),
    "trim": ("Edit", "edit:trim_command", "Take the silence away from both ends of a recording."),
    "join": ("Edit", "edit:join_command", "Put recordings of the same sensor one behind the other."),
    "gain": ("Edit", "edit:gain_command", "Make a recording stronger or weaker."),
    "mask": (
        "Edit",
        "edit:mask_command",
        "Silence some channels of a recording, or replace them by their neighbours.",
    ),
    "resample": ("Edit", "edit:resample_command", "Bring a recording to another rate."),
    "export": (
        "Edit",
        "import_export:export_command",
        "Write a recording to the format that the output's name says, and say what that format cannot hold.",
    ),
    "solve": (
        "Reproduce",
        "solve_play:solve_command",
        "Work out the drive with which the array presses as the sensor felt, frame by frame.",
    ),
    "exposure": (
        "Reproduce",
        "exposure:exposure_command",
        "Work out the sound level of every frame of a drive at ears and palm, and hold it against a profile.",
    ),
    "play": (
        "Reproduce",
        "solve_play:play_command",
        "Play a drive, and re-record what it presses when the device is virtual.",
    ),
    "stop": ("Reproduce", "stop:stop_command", "Silence whatever plays, at once."),
    "live": (
        "Reproduce",
        "live:live_command",
        "Play what a sensor feels while it feels it: touch here, felt there, 13 ms later.",
    ),
    "loop": (
        "Reproduce",
        "loop:loop_command",
        "Take a recording through everything: solve, play, re-record, correct, play again, compare, report.",
    ),
    "compare": (
        "Judge",
        "compare:compare_command",
        "Compare a re-recording with its original: waveform, spectrum, level, place, delay, and what skin makes of it.",
    ),
    "budget": (
        "Judge",
        "budget:budget_command",
        "Tell what each stage of a reproduction on the virtual rig loses: mapping, solver, hold, transducers, sensor.",
    ),
    "paper": (
        "Research",
        "paper:paper_command",
        "Make the paper's figures again on a virtual rig, in the paper's mode and in the best one, with their numbers.",
    ),
}
"""A group of `terminal.GROUPS`, where the command is, and its first line, by the name that people type, in the order of
the work."""

FOLDERS: Mapping[str, tuple[str, str]] = {
    "calibrate": (
        "Calibrate",
        "Turn a recording into pressure: midair calibrate RECORDING. What a calibration is measured with: "
        "against a reference (measure), by a tone of known level (tone), by a beam (beam). And an array's "
        "transducers (array).",
    ),
    "sweep": (
        "Research",
        "Solve many targets on many processes, and report E: all binary patterns of the paper's simulation "
        "(5.1) over strengths and heights, or recordings under many settings.",
    ),
    "study": (
        "Research",
        "Plan a study on people, run it one participant at a time, and analyse it.",
    ),
}
"""Commands that have commands below them: a group, and what their help says."""

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
"""Commands without bars, meters and questions of their own, and how often each goes through what it works on: a bar
with the time left shows when they take long."""


def command_of(tokens: Sequence[str]) -> str:
    """The command of a line, with the folder that it is in: "cut", "calibrate", "calibrate measure"."""
    return next((name for name in (" ".join(tokens[:2]), *tokens[:1]) if name in PASSES), "")


def __getattr__(name: str) -> App:
    """A command to be put among others, imported now: `solve_app`."""
    typed = name.removesuffix("_app")
    if typed == name or typed not in COMMANDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, command = COMMANDS[typed][1].partition(":")
    return imported(getattr(import_module(f"{__name__}.{module}"), command), typed)


__all__ = ["COMMANDS", "FOLDERS", "PASSES", "command_of"]
