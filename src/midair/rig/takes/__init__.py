"""Record takes of a sensor, with meters and triggers while they run."""

from .meters import Levels as Levels
from .take import Subject as Subject
from .take import last_subject as last_subject
from .take import record_take as record_take
from .take import store_subject as store_subject
from .take import take_path as take_path
from .take_state import Companion as Companion
from .take_state import Drift as Drift
from .take_state import RecordSettings as RecordSettings
from .take_state import StageStroke as StageStroke
from .take_state import Take as Take
from .take_state import TakeOrder as TakeOrder
from .take_state import View as View
from .take_state import Watcher as Watcher
from .take_state import event_message as event_message
from .take_state import move_to_start as move_to_start
from .take_state import take_problems as take_problems
