import numpy as np
import pytest

from midair.solvers.terms.level import automatic_level


@pytest.mark.parametrize(("peak", "level"), [(0.05, 0.5), (0.1, 1.0), (3.0, 1.0), (1e-4, 0.05), (0.0, 0.05)])
def test_the_loudest_target_is_a_tenth_of_the_focus_at_the_level(peak, level):
    assert automatic_level(np.array([[0.0, peak / 2], [peak, 0.0]])) == pytest.approx(level)
