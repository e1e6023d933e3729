"""Record takes of a sensor, with meters and triggers while they run."""

from midair.rig.takes.capture import capture_recording
from midair.rig.takes.clocks import Drift
from midair.rig.takes.event_messages import event_message, problems
from midair.rig.takes.meters import Levels
from midair.rig.takes.stroking import Stroking, bring_to_start
from midair.rig.takes.take import record_take
from midair.rig.takes.take_names import Subject, remember, remembered, take_path
from midair.rig.takes.take_plan import Companion, Take, TakeOrder, TakePlan, View

__all__ = [
    "Companion",
    "Drift",
    "Levels",
    "Stroking",
    "Subject",
    "Take",
    "TakeOrder",
    "TakePlan",
    "View",
    "bring_to_start",
    "problems",
    "capture_recording",
    "record_take",
    "remember",
    "remembered",
    "take_path",
    "event_message",
]
