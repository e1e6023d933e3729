import numpy as np
import pytest
from scipy.stats import ncf, nct

from midair.study.statistics.anova import eta_squared_limits, noncentral_t_limits


@pytest.mark.parametrize(("t", "df"), [(2.5, 9), (-5.0, 7), (0.0, 5), (40.0, 30), (900.0, 1), (3.0, 1000)])
def test_limits_of_t_have_the_tails_of_the_noncentral_t(t, df):
    low, high = noncentral_t_limits(t, df)
    assert nct.cdf(t, df, low) == pytest.approx(0.975, abs=1e-6)
    assert nct.cdf(t, df, high) == pytest.approx(0.025, abs=1e-6)


def test_limits_of_eta_squared_have_the_tails_of_the_noncentral_f():
    low, high = eta_squared_limits(6.0, 2, 18)
    for limit, tail in ((low, 0.95), (high, 0.05)):
        assert ncf.cdf(6.0, 2, 18, 18 * limit / (1 - limit)) == pytest.approx(tail, abs=1e-6)
    assert eta_squared_limits(0.1, 2, 18)[0] == 0
    assert np.isnan(eta_squared_limits(np.nan, 2, 18)).all()


def test_limits_continue_to_very_large_values():
    for function, step in ((noncentral_t_limits, 1000.0), (lambda f, df: eta_squared_limits(f, 2, df), 1e6)):
        assert function(step * 1.0001, 3) == pytest.approx(function(step, 3), rel=1e-3)
    assert noncentral_t_limits(1e7, 9)[0] > 1e6
