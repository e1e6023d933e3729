"""Responses of nerve fibres by TouchSim, from a copy of the user (Saal, Delhaye et al., PNAS 114(28), 2017).

TouchSim states no licence: midair contains nothing of it, and calls its classes `Stimulus` and `AfferentPopulation`.
"""

import warnings
from typing import Any

import numpy as np

from midair.evaluate.perception import SkinModel
from midair.model import PressureFrames

FIBRES = {"SA1": "slowly adapting", "RA": "rapidly adapting", "PC": "Pacinian"}
"""Classes of fibres in TouchSim."""

LONGEST = 10.0
"""Duration in s of what is simulated, from the beginning."""


def afferent_rates(pressure: PressureFrames, model: Any) -> dict[str, float]:
    """Mean impulses per second of each class of `FIBRES`, for a fibre of each kind under the middle of each cell.

    `model` is the package of a copy. Displacements are those of `SkinModel` under each cell, and the fibres
    have no noise.
    """
    skin, pitch = SkinModel(), 1e3 * pressure.sensor.pitch
    held = np.asarray(pressure.pressure[: round(LONGEST * pressure.rate)])
    x, y = np.meshgrid(pressure.sensor.x, pressure.sensor.y)
    middles = 1e3 * np.stack([x.ravel(), y.ravel()], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        stimulus = model.Stimulus(
            trace=1e3 * skin.displacement(held.reshape(len(held), -1)).T,
            location=middles,
            fs=pressure.rate,
            pin_radius=min(1e3 * skin.radius, 0.49 * pitch),
        )
        rates = {}
        for name in FIBRES:
            kinds = range(len(model.Afferent.affparams[name]))
            fibres = [model.Afferent(name, location=at, idx=kind, noisy=False) for at in middles for kind in kinds]
            rates[name] = float(np.mean(model.AfferentPopulation(*fibres).response(stimulus).rate()))
    return rates
