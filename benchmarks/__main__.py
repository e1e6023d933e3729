"""Print, for the same targets, thread setting and run: error and time of each solver, and its ratio to the plain one.

Times are CPU times of this process on one BLAS thread, so that a busy machine changes the ratios little; the live
solver's frames are timed by the clock. Set-up (the factor of G) is included in every figure. "x floor" is the mean E
over the mean of the least errors known (`python -m benchmarks.floors`). Methods that know only the shape of a
field, and other packages, are judged after the best scale of their field.
"""

from __future__ import annotations

import argparse

from benchmarks.clock import load
from benchmarks.limits import limits
from benchmarks.sequence import budget, sequence
from benchmarks.static import static
from benchmarks.targets import TEN, beating_blob, binary, moving_blob, patterns, problem_of, towel
from benchmarks.yardstick import plain
from midair.solvers import METHODS, one_blas_thread

PARTS = ("static", "sequence", "live", "limits")


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    ask.add_argument("--others", type=int, default=30, help="random patterns beside the ten (default 30)")
    ask.add_argument("--seed", type=int, default=2024, help="that the random patterns are drawn with (default 2024)")
    ask.add_argument("--strengths", type=float, nargs="*", default=[0.1, 0.2], help="of the patterns (default .1 .2)")
    ask.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these parts (default all)")
    ask.add_argument("--frames", type=int, default=1200, help="frames of a sequence (default 1200)")
    ask.add_argument("--plain-frames", type=int, default=100, help="of them for the slow solvers (default 100)")
    ask.add_argument("--no-peers", action="store_true", help="leave other packages out")
    ask.add_argument(
        "--yardstick", help="file with paper_lm (default $MIDAIR_YARDSTICK, ../shared/baseline/paper_lm.py)"
    )
    ask.add_argument("--methods", nargs="*", default=list(METHODS), help="which solvers (default all)")
    said = ask.parse_args()
    if min(said.frames, said.plain_frames) < 40:
        ask.error("--frames and --plain-frames: expected 40 or more, since the first ten do not count")
    name, reference = plain(said.yardstick)
    spot, stroke = problem_of(moving_blob(said.frames), 0.1), towel(said.frames, 0.1)
    print(load())
    with one_blas_thread():
        if "static" in said.part:
            for strength in said.strengths:
                bits = patterns(said.others, said.seed)
                static(strength, bits, name, reference, said.methods, not said.no_peers)
        if "sequence" in said.part:
            beating = problem_of(beating_blob(min(said.frames, 200)), 0.1)
            for label, problem in (("moving blob", spot), ("beating blob", beating), ("towel stroke", stroke)):
                sequence(f"{label}, strength 0.1", problem, name, reference, said.methods, said.plain_frames)
        if "live" in said.part:
            budget("moving blob", spot)
            budget("towel stroke", stroke)
        if "limits" in said.part:
            limits(problem_of(binary([TEN[3]]), 0.1), name, reference)


if __name__ == "__main__":
    main()
