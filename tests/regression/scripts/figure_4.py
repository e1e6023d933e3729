"""Figure 4 of the paper on a coarse grid by the fast solver: `midair paper --figure 4` takes minutes.

One name is not fixed: when `figure_4` is renamed, this script follows.
"""

import json

import midair
from midair.paper import figure_4

coarse = midair.Settings().but(grid=midair.ControlGrid(rows=8, columns=8, pitch=22e-3 / 3), method="fast")
best = coarse.but(mapping="slow-bias", interpolate="pressure", precompensate=True)
print(json.dumps(figure_4(paper=coarse, best=best, duration=0.08, iterate=0).plain()))
