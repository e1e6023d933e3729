import pytest
from jinja2 import UndefinedError

from midair.figures.page import render_page


@pytest.mark.parametrize("simulated", [True, False])
def test_says_simulated_when_it_is(simulated):
    page = render_page("study/report.html.j2", title="A <b>", simulated=simulated, pictures=[], findings=[], notes="n")
    assert ("SIMULATED: no person was asked" in page) is simulated
    assert "<title>midair: A &lt;b&gt;</title>" in page


def test_a_value_that_is_missing_is_an_error():
    with pytest.raises(UndefinedError):
        render_page("study/report.html.j2", title="A", simulated=False)
