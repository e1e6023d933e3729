"""Cost and benefit of the quiet-ears term: `python -m benchmarks.quiet_ears`.

E at the control points, the loudest sound at either ear from the exposure check, and the radiation pressure on the palm
after the drive is attenuated to 110 dB at the ears. One static pattern (a ring of cells) and a towel stroke, each at
the level that its loudest frame needs.
"""

from __future__ import annotations

import argparse

from benchmarks.targets import GRID, TEN, binary, problem_of, towel
from midair.devices import measure_exposure
from midair.files import profile_named
from midair.model import Acoustics, AmplitudeFrames, TransducerArray
from midair.physics import focus_amplitude
from midair.solvers import solve

ARRAY = TransducerArray.autd3()


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.quiet_ears", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--strengths", type=float, nargs="+", default=[0.05, 0.1, 0.2, 0.3], help="strengths of the targets"
    )
    parser.add_argument("--weights", type=float, nargs="+", default=[0, 3, 30, 300], help="weights of the term")
    parser.add_argument("--frames", type=int, default=100, help="frames of the towel stroke (default 100)")
    options = parser.parse_args()
    focus = focus_amplitude(GRID, ARRAY)
    profile = profile_named("occupational-110")
    for strength in options.strengths:
        for name, amplitude in (
            ("pattern", problem_of(binary([TEN[3]]), strength).amplitude),
            ("towel", towel(options.frames, strength).amplitude),
        ):
            target = AmplitudeFrames(amplitude=focus * amplitude, rate=1000.0, grid=GRID)
            first = None
            for weight in options.weights:
                solution = solve(target, ARRAY, method="fast", level="auto", quiet_ears=weight, acoustics=Acoustics())
                found = measure_exposure(solution.drive, ARRAY, profile)
                ears = max(found.peak[0], found.peak[1])
                first = ears if first is None else first
                left = found.pressure * 10 ** (-max(found.excess, 0) / 10)
                error = 100 * solution.error[solution.plays].mean()
                print(
                    f"{name:8} strength {strength:.2f} weight {weight:6g}: E {error:5.1f} %, "
                    f"ears {ears:6.1f} dB ({ears - first:+5.1f}), palm {found.pressure:6.1f} Pa, "
                    f"at 110 dB {left:.2g} Pa",
                    flush=True,
                )


if __name__ == "__main__":
    main()
