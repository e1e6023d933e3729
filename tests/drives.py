"""Drives that are written without a solver, the plan of a study that presents one, and the log of what played."""

import json

import numpy as np

from midair.devices import VirtualArray, state_folder
from midair.files import save_solution
from midair.model import Drive, Placement, Solution, TransducerArray


class Loud(VirtualArray):
    """A virtual array that is treated as a real one with sound."""

    simulated, gated = False, True


def noise(frames, placement=None, level=1.0, rate=1000.0, seed=1):
    """A drive of random phases, of one unit if no placement is given."""
    array = (placement or Placement.grid(columns=1, rows=1)).array()
    phase = np.random.default_rng(seed).uniform(-10, 10, (frames, array.count))
    return Drive(phase=phase, level=level if np.ndim(level) else np.full(frames, level), rate=rate, array=array)


def save_drive(path, phase=None, level=0.001, *, frames=20, rate=1000.0, array=None, target=None, **more):
    """Write a drive, quiet and of four units if nothing else is stated, with its target; returns the path."""
    array = array or TransducerArray.autd3()
    phase = np.zeros((frames, array.count)) if phase is None else phase
    count = len(phase)
    drive = Drive(phase=phase, level=level if np.ndim(level) else np.full(count, level), rate=rate, array=array, **more)
    solved = {"error": np.zeros(count), "iterations": np.ones(count, int), "status": ("converged",) * count}
    save_solution(Solution(drive=drive, **solved), path, target=target)
    return path


def plan_of(source):
    """TOML of a study of one person, who is presented one drive."""
    return f"""
name = "one"
participants = 1
seed = 1
consent = "You may stop at any time."
questions = [{{ name = "which", kind = "choice", text = "Which?", options = ["one", "two"], truth = "object" }}]
stimuli = [{{ name = "f", kind = "drive", source = "{source}", levels = {{ object = "one" }} }}]
blocks = [{{ name = "all", stimuli = ["f"], questions = ["which"] }}]
"""


def log():
    """The entries of the log of playback."""
    return [json.loads(line) for line in (state_folder() / "played.jsonl").read_text(encoding="utf-8").splitlines()]
