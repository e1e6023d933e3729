"""The command line: what a person types.

Each file adds its commands to the one app in app.py.
"""

from midair.cli import (
    demo,
    doctor,
    exposure,
    info,
    recordings,
    reproduction,
    stop,
    study,
    sweep,
    sweep_recordings,
    sweep_report,
)
from midair.cli.app import app, main, run

app.command(study.app)
app.command(sweep.app)

__all__ = [
    "app",
    "demo",
    "doctor",
    "exposure",
    "info",
    "main",
    "recordings",
    "reproduction",
    "run",
    "stop",
    "study",
    "sweep",
    "sweep_recordings",
    "sweep_report",
]
