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

from typing import TYPE_CHECKING

from midair.lazy import lazy_names

if TYPE_CHECKING:
    from midair import calibration as calibration
    from midair import correct as correct
    from midair import datasets as datasets
    from midair import devices as devices
    from midair import dsp as dsp
    from midair import errors as errors
    from midair import evaluate as evaluate
    from midair import figures as figures
    from midair import files as files
    from midair import model as model
    from midair import paper as paper
    from midair import patterns as patterns
    from midair import physics as physics
    from midair import pipeline as pipeline
    from midair import recordings as recordings
    from midair import rig as rig
    from midair import settings as settings
    from midair import solvers as solvers
    from midair import studio as studio
    from midair import study as study
    from midair import sweep as sweep
    from midair import targets as targets
    from midair import view as view
    from midair.calibration import calibrate as calibrate
    from midair.files import load as load
    from midair.files import load_calibration as load_calibration
    from midair.files import open_take as open_take
    from midair.files import save as save
    from midair.model import Acoustics as Acoustics
    from midair.model import AmplitudeFrames as AmplitudeFrames
    from midair.model import Calibration as Calibration
    from midair.model import ControlGrid as ControlGrid
    from midair.model import Drive as Drive
    from midair.model import Medium as Medium
    from midair.model import PressureFrames as PressureFrames
    from midair.model import Recording as Recording
    from midair.model import SensorGrid as SensorGrid
    from midair.model import Solution as Solution
    from midair.model import TransducerArray as TransducerArray
    from midair.physics import propagate as propagate
    from midair.rig import compare as compare
    from midair.rig import live as live
    from midair.rig import loop as loop
    from midair.rig import open_rig as open_rig
    from midair.rig import open_tracker as open_tracker
    from midair.rig import play as play
    from midair.rig import record as record
    from midair.settings import Settings as Settings
    from midair.stages import prepare as prepare
    from midair.stages import solve as solve
    from midair.version import __version__ as __version__
else:
    __getattr__, __dir__ = lazy_names(__name__)
