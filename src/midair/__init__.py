"""midair: a tape recorder for touch.

Records what an object does to skin, and plays it back on a bare palm with focused ultrasound::

    recording = midair.load("towel.h5")
    pressure = midair.calibrate(recording, calibration)
    target = midair.prepare(pressure)
    solution = midair.solve(target, midair.model.TransducerArray.autd3())
    field = midair.propagate(solution.drive, target.grid)

Importing it loads NumPy and nothing else that is heavy.
"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from midair import errors, model, physics

# The stages are verbs: `midair.solve` is the function. The packages of the same name are imported by it first, so
# that no later import of theirs can take the name.
from midair.calibration import calibrate
from midair.evaluate import compare
from midair.files import load, load_calibration, save
from midair.physics import propagate
from midair.solvers import solve
from midair.targets import prepare
from midair.version import __version__

if TYPE_CHECKING:
    from midair import datasets, flow, recordings, study

__all__ = [
    "__version__",
    "calibrate",
    "compare",
    "datasets",
    "recordings",
    "errors",
    "flow",
    "load",
    "load_calibration",
    "model",
    "physics",
    "prepare",
    "propagate",
    "save",
    "solve",
    "study",
]


def __getattr__(name: str) -> ModuleType:
    """The modules that many programs do without, imported when they are first asked for."""
    if name in ("datasets", "flow", "recordings", "study"):
        return import_module(f"midair.{name}")
    raise AttributeError(f"module 'midair' has no attribute {name!r}")
