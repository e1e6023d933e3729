"""midair: record touch with a pressure sensor and replay it on a bare palm with focused ultrasound.

::

    take = midair.record("virtual:towel", 1.0)
    pressure = midair.calibrate(take.recording, take.calibration)
    target = midair.prepare(pressure)
    solution = midair.solve(target, midair.TransducerArray.autd3())
    played = midair.play(solution, "virtual")

The stages are functions of this package; the data classes that they exchange are in `midair.model`; every other part
is a subpackage. Names are imported on first use, so ``import midair`` loads nothing else.
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
"""Functions and classes of this package and the package that defines each; all other names are subpackages."""


def __getattr__(name: str) -> Any:
    """Import a name on first use and cache it."""
    if name in _ELSEWHERE:
        globals()[name] = getattr(import_module(_ELSEWHERE[name]), name)
        return globals()[name]
    if name in __all__:
        return import_module(f"midair.{name}")
    raise AttributeError(f"module 'midair' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Public names only."""
    return sorted(__all__)
