"""midair: a tape recorder for touch.

Records what an object does to skin, and plays it back on a bare palm with focused ultrasound::

    take = midair.record("virtual:towel", 1.0)
    pressure = midair.calibrate(take.recording, take.calibration)
    target = midair.prepare(pressure)
    solution = midair.solve(target, midair.TransducerArray.autd3())
    played = midair.play(solution, "virtual")

Verbs are functions here; what they hand to each other are nouns, all of them in `midair.model`; the rooms of the house
are modules. Importing it loads nothing else: every name is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from midair.version import __version__

if TYPE_CHECKING:
    from midair import (
        calibration,
        correct,
        datasets,
        devices,
        dsp,
        errors,
        evaluate,
        figures,
        files,
        model,
        paper,
        physics,
        pipeline,
        recordings,
        rig,
        settings,
        solvers,
        studio,
        study,
        sweep,
        targets,
        testing,
        view,
    )
    from midair.calibration import calibrate
    from midair.evaluate import compare
    from midair.files import load, load_calibration, open_take, save
    from midair.model import (
        Acoustics,
        AmplitudeFrames,
        Calibration,
        ControlGrid,
        Drive,
        Medium,
        PressureFrames,
        Recording,
        SensorGrid,
        Solution,
        TransducerArray,
    )
    from midair.physics import propagate
    from midair.rig import live, loop, open_rig, play, record
    from midair.settings import Settings
    from midair.solvers import solve
    from midair.targets import prepare

__all__ = [
    "Acoustics",
    "AmplitudeFrames",
    "Calibration",
    "ControlGrid",
    "Drive",
    "Medium",
    "PressureFrames",
    "Recording",
    "SensorGrid",
    "Settings",
    "Solution",
    "TransducerArray",
    "__version__",
    "calibrate",
    "calibration",
    "compare",
    "correct",
    "datasets",
    "devices",
    "dsp",
    "errors",
    "evaluate",
    "figures",
    "files",
    "live",
    "load",
    "load_calibration",
    "loop",
    "model",
    "open_rig",
    "open_take",
    "paper",
    "physics",
    "pipeline",
    "play",
    "prepare",
    "propagate",
    "record",
    "recordings",
    "rig",
    "save",
    "settings",
    "solve",
    "solvers",
    "studio",
    "study",
    "sweep",
    "targets",
    "testing",
    "view",
]

_ELSEWHERE = {
    **dict.fromkeys(
        (
            "Acoustics",
            "AmplitudeFrames",
            "Calibration",
            "ControlGrid",
            "Drive",
            "Medium",
            "PressureFrames",
            "Recording",
            "SensorGrid",
            "Solution",
            "TransducerArray",
        ),
        "midair.model",
    ),
    **dict.fromkeys(("load", "load_calibration", "open_take", "save"), "midair.files"),
    **dict.fromkeys(("live", "loop", "open_rig", "play", "record"), "midair.rig"),
    "Settings": "midair.settings",
    "calibrate": "midair.calibration",
    "compare": "midair.evaluate",
    "prepare": "midair.targets",
    "propagate": "midair.physics",
    "solve": "midair.solvers",
}
"""Nouns and verbs of this face and where they are from; all other names are rooms."""


def __getattr__(name: str) -> Any:
    """Every name is imported when it is first asked for, and kept."""
    if name in _ELSEWHERE:
        globals()[name] = getattr(import_module(_ELSEWHERE[name]), name)
        return globals()[name]
    if name in __all__:
        return import_module(f"midair.{name}")
    raise AttributeError(f"module 'midair' has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names of this face, and no others."""
    return sorted(__all__)
