"""A simulated calibration bench: a coupler, a probe, and a reference with a small error."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from midair.array_types import Array
from midair.calibration import Reference, ReferencedTake, noise_signal, sweep_signal
from midair.errors import FileError
from midair.files import save
from midair.model import RATE, Progress, Provenance, Recording, SensorGrid
from midair.physics import SensorModel, sense


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationBench:
    """A bench that applies a known pressure to a virtual sensor."""

    model: SensorModel = field(default_factory=SensorModel)
    """The sensor; hidden from the analysis."""
    rate: float = RATE
    """Rate of sensor and reference in Hz."""
    reference_sensitivity: float = 50e-3
    """Sensitivity in V/Pa that the reference's certificate states."""
    reference_error: float = 0.0
    """Relative error of the certificate."""
    reference_uncertainty: float = 0.0
    """Relative standard uncertainty (k = 1) that the certificate states."""
    reference_noise: float = 2e-5
    """One-sided noise density in Pa/sqrt(Hz)."""
    seating: float = 0.0
    """Relative standard deviation of the pressure from take to take that the reference does not measure."""
    seed: int = 0

    def take(self, pressure: Array, *, cell: int | None = None, number: int = 0) -> ReferencedTake:
        """Record a take of `pressure`, shape (frame,), in Pa, on all cells or on one; `number` seeds its noise."""
        recording, said = self.recordings(pressure, cell=cell, number=number)
        reference = Reference.read(
            said, sensitivity=self.reference_sensitivity, uncertainty=self.reference_uncertainty, name=said.sensor.name
        )
        return ReferencedTake(recording=recording, reference=reference, cell=cell)

    def recordings(self, pressure: Array, *, cell: int | None = None, number: int = 0) -> tuple[Recording, Recording]:
        """Recordings of the sensor and of the reference while `pressure` acts, both in V."""
        rng = np.random.default_rng((self.seed, number, 0 if cell is None else cell + 1))
        grid = self.model.grid
        acting = np.zeros((len(pressure), grid.count))
        acting[:, slice(None) if cell is None else cell] = pressure[:, None] if cell is None else pressure
        acting *= 1 + self.seating * rng.standard_normal()
        volts = sense(self.model, acting.reshape(-1, *grid.shape), self.rate, rng=rng)
        heard = pressure + self.reference_noise * np.sqrt(self.rate / 2) * rng.standard_normal(len(pressure))
        said = heard * self.reference_sensitivity * (1 + self.reference_error)
        where = "all cells" if cell is None else f"cell {cell}"
        life = Provenance(source=f"virtual bench: {where}, take {number}", simulated=True, notes={"pressed": where})
        alone = SensorGrid(rows=1, columns=1, name="virtual reference")
        return (
            Recording(samples=volts, rate=self.rate, sensor=grid, provenance=life),
            Recording(samples=said.reshape(-1, 1, 1), rate=self.rate, sensor=alone, provenance=life),
        )

    def quiet(self, duration: float) -> Recording:
        """A recording without pressure."""
        # No take has this number, so the noise differs from that of every take.
        return self.recordings(np.zeros(round(duration * self.rate)), number=10**6)[0]


def practice_bench(seed: int = 0) -> CalibrationBench:
    """A bench whose sensor has channel spread, delays and crosstalk, and a reference accurate to 1 %."""
    rng = np.random.default_rng((seed, 7))
    grid = SensorGrid(name=f"practice sensor {seed}")
    away = np.array([[abs(i // 4 - k // 4) + abs(i % 4 - k % 4) for k in range(16)] for i in range(16)])
    crosstalk = np.eye(16) + 0.03 * (away == 1) * (1 + 0.2 * rng.standard_normal((16, 16))) + 0.004 * (away == 2)
    model = SensorModel(grid=grid, delay=rng.uniform(0, 3e-4, grid.shape), crosstalk=crosstalk, saturation=6.0)
    # The error is drawn from the uncertainty that the certificate states.
    error = 0.005 * float(rng.standard_normal())
    return CalibrationBench(
        model=model.with_spread(seed=seed), reference_uncertainty=0.005, reference_error=error, seating=0.002, seed=seed
    )


PRACTICE_RECORDINGS = 22
"""Number of recordings: all cells at five levels, each of the sixteen alone, and one without pressure."""


def write_practice_recordings(
    folder: Path,
    *,
    kind: Literal["noise", "sweep"] = "noise",
    duration: float = 15.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> str:
    """Write simulated recordings of a calibration, of `duration` s each; return the command that computes it.

    All cells at five levels, each cell alone, and one without pressure, in a folder that is created if it does not
    exist. FileError if one of the files exists already.
    """
    bench = practice_bench(seed)
    folder.mkdir(parents=True, exist_ok=True)
    plan: list[tuple[str, int | None, float]] = [(f"all-{level}Pa", None, float(level)) for level in (1, 2, 5, 10, 15)]
    plan += [(f"cell-{cell:02}", cell, 10.0) for cell in range(bench.model.grid.count)]
    names = [name for name, _, _ in plan]
    for path in [folder / f"{name}{end}.h5" for name in names for end in ("", "-reference")]:
        if path.exists():
            raise FileError(f"{path}: is there already; give another folder")
    rng = np.random.default_rng((seed, 11))
    for number, (name, cell, level) in enumerate(plan):
        signal = sweep_signal(1.0, duration - 1) if kind == "sweep" else noise_signal(1.0, duration, rng=rng)
        recording, reference = bench.recordings(signal * level, cell=cell, number=number)
        save(recording, folder / f"{name}.h5")
        save(reference, folder / f"{name}-reference.h5")
        if progress:
            progress(number + 1, PRACTICE_RECORDINGS)
    save(bench.quiet(duration), folder / "quiet.h5")
    if progress:
        progress(PRACTICE_RECORDINGS, PRACTICE_RECORDINGS)
    return (
        f"midair calibrate measure {folder}/all-*Pa.h5 {folder}/cell-??.h5 "
        f"--reference {folder}/all-*-reference.h5 {folder}/cell-*-reference.h5 --reference-sensitivity 50mV/Pa "
        f"--reference-uncertainty 0.01 --quiet {folder}/quiet.h5 --figure {folder}/calibration.html"
    )
