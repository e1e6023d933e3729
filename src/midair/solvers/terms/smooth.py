"""Penalty on phase changes between frames.

A transducer whose phase jumps by d loses amplitude while it follows, down to cos(d / 2); the loss repeats at the frame
rate and is audible (Suzuki et al., IEEE Trans. Haptics 13 (2020)). The term is mu mean_n |q_n - q_n'|^2 / 2 = mu mean_n
(1 - cos(theta_n - theta_n')) between neighbouring frames.
"""

from dataclasses import dataclass
from typing import Any

from midair.solvers.backend import Numbers, Rows
from midair.solvers.terms.term import PhaseTerm


@dataclass(frozen=True, slots=True, kw_only=True)
class Smooth(PhaseTerm):
    """Weight of phase changes; .01 is strong."""

    keyword = "smooth"
    help = "Penalty on phase change between frames; 0.01 is strong."

    weight: float
    """mu."""

    def cost(self, xp: Any, q: Rows, before: Rows) -> tuple[Numbers, Rows]:
        """The cost mu mean_n (1 - Re(conj(q_n) q_n')) with the previous row q', and its gradient.

        The gradient is mu / N Im(q_n conj(q_n' + q_n'')) with both neighbours; the last row has one.
        """
        count = q.shape[1]
        earlier = xp.concat([before, q[:-1, :]], axis=0)
        later = xp.concat([q[1:, :], xp.zeros_like(before)], axis=0)
        kept = xp.real(xp.vecdot(earlier, q))
        gradient = (self.weight / count) * xp.imag(q * xp.conj(earlier + later))
        return self.weight * (1 - kept / count), gradient
