import pickle
from dataclasses import replace

import numpy as np
import pytest

from midair.solvers import METHODS, Fast, SolverSettings, solver


def test_every_name_makes_its_method():
    for name in METHODS:
        assert solver(name) == METHODS[name]()


def test_settings_are_an_ordinary_class():
    made = SolverSettings(method=Fast(batch=3), guard=np.float32(0.02), quiet_palm=np.float32(0.1), jobs=4)
    assert pickle.loads(pickle.dumps(made)) == made == replace(made, jobs=None)
    assert (made.ring.margin, made.quiet[0].weight) == (pytest.approx(0.02), pytest.approx(0.1))
    assert made.asked == {"guard", "quiet-palm"}


def test_iterations_and_start_reach_those_that_have_them():
    assert (solver("lm", iterations=(7, 3), start="zero").iterations, solver("lm", start="zero").start) == (7, "zero")
    assert solver("lm", iterations=4).warm_iterations == 4
    assert solver("fast", iterations=4, start="previous").iterations == 4
