import numpy as np

from midair.model import PalmPath


def palm_path(time, centre, *, tilt=0.0, confidence=1.0):
    """A palm at centres (pose, 3) in m: level, or tilted about y by an angle in rad."""
    one = np.ones((len(time), 1))
    return PalmPath(
        time=time,
        centre=centre,
        normal=one * [np.sin(tilt), 0, -np.cos(tilt)],
        fingers=one * [0.0, 1.0, 0.0],
        confidence=np.broadcast_to(confidence, len(time)).copy(),
    )
