"""The command line: what a person types."""

from .app import app as app
from .app import load as load
from .app import main as main
from .app import run as run
