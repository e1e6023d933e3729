"""Sessions of a study: presentation, questions, timing, the event log and simulated participants."""

from .event_log import read_events as read_events
from .participant import SimulatedParticipant as SimulatedParticipant
from .participant import SimulatedScreen as SimulatedScreen
from .presenters import ArrayPresenter as ArrayPresenter
from .presenters import ExperimenterPresenter as ExperimenterPresenter
from .presenters import Headphones as Headphones
from .presenters import MarkedPresenter as MarkedPresenter
from .presenters import MaskedPresenter as MaskedPresenter
from .presenters import Presenter as Presenter
from .presenters import SilentPresenter as SilentPresenter
from .presenters import TextPresenter as TextPresenter
from .trials import InstantClock as InstantClock
from .trials import Reply as Reply
from .trials import Session as Session
from .trials import TrialStep as TrialStep
from .trials import run as run
