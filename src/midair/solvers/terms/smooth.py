"""Phases that change little from frame to frame.

A transducer whose phase jumps by d loses loudness while it follows, down to cos(d / 2), and the loss repeats with the
frames and is heard (Suzuki et al., IEEE Trans. Haptics 13 (2020)). The term is
mu mean_n |q_n - q_n'|^2 / 2 = mu mean_n (1 - cos(theta_n - theta_n')) between neighbouring frames.
"""

from typing import Any

from midair.solvers.backend import Numbers, Rows


def change(xp: Any, q: Rows, before: Rows, weight: float) -> tuple[Numbers, Rows]:
    """The cost mu mean_n (1 - Re(conj(q_n) q_n')) of each row and the one before it, with its gradient by the phases.

    Parameters
    ----------
    xp : module
        Module of the array API standard.
    q : array of complex, shape (row, transducer)
        Drives of magnitude 1, one frame after another.
    before : array of complex, shape (1, transducer)
        Drive of the frame before the first, which is not moved.
    weight : float
        mu.

    Returns
    -------
    cost : array, shape (row,)
    gradient : array, shape (row, transducer)
        Gradient by the phases: mu / N Im(q_n conj(q_n' + q_n'')), with the rows on both sides; the last row has one.
    """
    count = q.shape[1]
    earlier = xp.concat([before, q[:-1, :]], axis=0)
    later = xp.concat([q[1:, :], xp.zeros_like(before)], axis=0)
    kept = xp.real(xp.vecdot(earlier, q))
    gradient = (weight / count) * xp.imag(q * xp.conj(earlier + later))
    return weight * (1 - kept / count), gradient
