"""Penalty on phase changes between frames.

A transducer whose phase jumps by d loses amplitude while it follows, down to cos(d / 2); the loss repeats at the frame
rate and is audible (Suzuki et al., IEEE Trans. Haptics 13 (2020)). The term is mu mean_n |q_n - q_n'|^2 / 2 = mu mean_n
(1 - cos(theta_n - theta_n')) between neighbouring frames.
"""

from typing import Any

from midair.solvers.backend import Numbers, Rows


def change(xp: Any, q: Rows, before: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost mu mean_n (1 - Re(conj(q_n) q_n')) of each row (row,), and its gradient by the phases (row, transducer).

    q (row, transducer) are drives of magnitude 1 in order of time, q' the previous row; `before` (1, transducer) is the
    fixed drive before the first. The gradient is mu / N Im(q_n conj(q_n' + q_n'')) with both neighbours; the last row
    has one.
    """
    count = q.shape[1]
    earlier = xp.concat([before, q[:-1, :]], axis=0)
    later = xp.concat([q[1:, :], xp.zeros_like(before)], axis=0)
    kept = xp.real(xp.vecdot(earlier, q))
    gradient = (weight / count) * xp.imag(q * xp.conj(earlier + later))
    return weight * (1 - kept / count), gradient
