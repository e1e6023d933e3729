"""Record takes of a sensor, with meters and triggers while they run."""

from midair.rig.takes.capture import capture_recording
from midair.rig.takes.clocks import Drift
from midair.rig.takes.event_messages import event_message, take_problems
from midair.rig.takes.meters import Levels
from midair.rig.takes.stage_stroke import StageStroke, move_to_start
from midair.rig.takes.take import record_take
from midair.rig.takes.take_names import Subject, last_subject, store_subject, take_path
from midair.rig.takes.take_plan import Companion, Take, TakeOrder, TakePlan, View

__all__ = [
    "Companion",
    "Drift",
    "Levels",
    "StageStroke",
    "Subject",
    "Take",
    "TakeOrder",
    "TakePlan",
    "View",
    "move_to_start",
    "take_problems",
    "capture_recording",
    "record_take",
    "store_subject",
    "last_subject",
    "take_path",
    "event_message",
]
