"""An error budget as a waterfall."""

import pytest

from midair.evaluate import Leak, StageOutput, budget
from midair.figures import budget_figure

LEAK = Leak(peak=0.5, typical=0.2, place=(0.0, 0.0), wanted=1.0)


@pytest.mark.long
@pytest.mark.parametrize("simulated", [True, False])
def test_a_row_of_panels_for_each_budget(tones, check_figure, simulated):
    def made(factor):
        pressure = tones(factor, simulated=simulated)
        outputs = [StageOutput(name="one", what="", pressure=pressure, leak=LEAK)]
        return budget(tones(simulated=simulated), outputs, strength=0.1)

    close, far = made(0.9), made(0.2)
    figure = budget_figure([("paper", far), ("best", close)])
    check_figure(figure, "(dB)", "Hz", "paper, strength 0.10", "best, strength 0.10", simulated=simulated)
    shown = [axis.patches[0].get_width() for axis in figure.axes[::2]]
    assert shown == pytest.approx([each.stages[0].so_far.distortion_ratio for each in (far, close)])
    assert shown[0] < shown[1]
