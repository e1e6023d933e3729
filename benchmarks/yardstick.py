"""Plain form of the paper's method from a separate file, or this package's form if there is none."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.solvers import PLAIN, Problem
from midair.solvers.damped_step import PlainForm

Plain = Callable[[np.ndarray, np.ndarray, int, "np.ndarray | None"], np.ndarray]
"""(G, p, iterations, initial x) -> x = [theta, psi]."""


def plain() -> tuple[str, Plain]:
    """Name and function of the plain form: paper_lm of the file $MIDAIR_YARDSTICK, if there is one."""
    file = Path(os.environ.get("MIDAIR_YARDSTICK", "../shared/baseline/paper_lm.py"))
    if not file.exists():
        return "lm (no yardstick found)", _own
    spec = importlib.util.spec_from_file_location("yardstick", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return f"plain ({file.name})", lambda G, p, iterations, x: module.paper_lm(G, p, iterations, x)


def _own(G: np.ndarray, p: np.ndarray, iterations: int, x: np.ndarray | None) -> np.ndarray:
    form = PlainForm(problem=Problem(G=G, amplitude=p[None]))
    largest = max(float((np.abs(G) ** 2).sum(axis=0).max()), float((p**2).max()))
    state = form.at(p, np.zeros(sum(G.shape)) if x is None else x, PLAIN.tau * largest)
    while state.iterations < iterations:
        state = replace(PLAIN.step(form, p, state), status=None)
    return state.x
