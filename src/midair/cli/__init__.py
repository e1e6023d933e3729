"""The command line: what a person types."""

from .app import app as app
from .app import main as main
from .app import run as run
