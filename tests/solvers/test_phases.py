import numpy as np

from midair.solvers.phases import hold, rippled, unit


def test_unit_of_nothing_is_one():
    np.testing.assert_array_equal(unit(np.array([0, 2j])), [1, 1j])


def test_a_ripple_turns_each_by_less_than_a_third_of_a_radian_and_differently():
    turned = np.angle(rippled(np.ones(12, complex)))
    assert 0.2 < np.abs(turned).max() <= 0.3
    assert len(np.unique(turned.round(6))) == 12


def test_hold_keeps_the_last_audible_phases():
    phase = np.array([[9.0], [1.0], [9.0], [9.0], [2.0]])
    np.testing.assert_array_equal(hold(phase, np.array([1, 4]))[:, 0], [0, 1, 1, 1, 2])
