"""The command line: what a person types.

Each file adds its commands to the one app in app.py.
"""

from midair.cli import demo, doctor, info, recordings, reproduction, study
from midair.cli.app import app, main, run

app.command(study.app)

__all__ = ["app", "demo", "doctor", "info", "main", "recordings", "reproduction", "run", "study"]
