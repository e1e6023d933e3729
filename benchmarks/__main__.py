"""Print error and time of each solver, and its time ratio to the plain solver, on the same targets in one run.

Times are CPU times of this process on one BLAS thread, so that other load changes the ratios little; the frames of the
live solver are timed by wall clock. All figures include the set-up (factorisation of G). "x floor" is the mean E over
the mean of the lowest known errors (`floors.json`). Methods that only give the shape of a field
are rated after the best scaling of their field.
"""

from __future__ import annotations

import argparse

from benchmarks.clock import load
from benchmarks.published import PUBLISHED
from benchmarks.sequence import budget, sequence
from benchmarks.static import static
from benchmarks.targets import beating_blob, moving_blob, patterns, problem_of, towel
from benchmarks.yardstick import plain
from midair.solvers import METHODS, one_blas_thread

PARTS = ("static", "sequence", "live")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    parser.add_argument("--others", type=int, default=30, help="number of random patterns besides the ten (default 30)")
    parser.add_argument("--seed", type=int, default=2024, help="seed of the random patterns (default 2024)")
    parser.add_argument(
        "--strengths", type=float, nargs="*", default=[0.1, 0.2], help="strengths of the patterns (default .1 .2)"
    )
    parser.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these parts (default all)")
    parser.add_argument("--frames", type=int, default=1200, help="frames of a sequence (default 1200)")
    parser.add_argument("--plain-frames", type=int, default=100, help="frames for the slow solvers (default 100)")
    parser.add_argument("--methods", nargs="*", default=[*METHODS, *PUBLISHED], help="names of solvers (default all)")
    options = parser.parse_args()
    if min(options.frames, options.plain_frames) < 40:
        parser.error("--frames and --plain-frames: expected 40 or more, because the first ten frames are ignored")
    name, reference = plain()
    spot, stroke = problem_of(moving_blob(options.frames), 0.1), towel(options.frames, 0.1)
    print(load())
    with one_blas_thread():
        if "static" in options.part:
            for strength in options.strengths:
                bits = patterns(options.others, options.seed)
                static(strength, bits, name, reference, options.methods)
        if "sequence" in options.part:
            beating = problem_of(beating_blob(min(options.frames, 200)), 0.1)
            for label, problem in (("moving blob", spot), ("beating blob", beating), ("towel stroke", stroke)):
                sequence(f"{label}, strength 0.1", problem, name, reference, options.methods, options.plain_frames)
        if "live" in options.part:
            budget("moving blob", spot)
            budget("towel stroke", stroke)


if __name__ == "__main__":
    main()
