"""Peak memory and time of each command on a long recording and a long drive, which are created first.

    python -m benchmarks.memory --seconds 600

The recording has 16 channels of float32 at 1 kHz, as WAV and as a recording of midair; the drive has 996 transducers
at 1 kHz. Each command is a separate process. Its peak is the largest resident set (VmHWM; ru_maxrss of a child includes
the peak of its parent program), including the interpreter and all libraries.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from midair.files import save, save_solutions
from midair.model import Drive, Provenance, Recording, SensorGrid, Solution, TransducerArray

RATE = FRAME_RATE = 1000


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.memory", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--seconds", type=float, default=600, help="length of the recording and the drive (default 600)"
    )
    parser.add_argument("--folder", type=Path, help="folder for the temporary files (default: system folder)")
    parser.add_argument("--only", nargs="*", help="names of rows to run (default all)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        os.chdir(folder)
        _ENV["MIDAIR_STATE"] = str(Path("state").resolve())
        make_all(options.seconds)
        print(f"{options.seconds:g} s: recording of 16 channels at 1 kHz, drive of 996 transducers at 1 kHz")
        print(f"{'command':60} {'peak MB':>8} {'s':>7}")
        for name, words in commands(options.seconds):
            if not options.only or name in options.only:
                peak, lasted, status = weighed(words)
                said_of = "" if status == 0 else f"  status {status}"
                print(f"{'midair ' + ' '.join(words):60} {peak:8.0f} {lasted:7.1f}{said_of}", flush=True)


def commands(seconds: float) -> Iterator[tuple[str, list[str]]]:
    """Name and arguments of each command, in an order in which each one finds its files."""
    middle = f"{seconds / 2:g}s"
    yield "info", ["info", "long.h5"]
    yield "cut", ["cut", "long.h5", "cut.h5", "--start", middle, "--end", f"{seconds / 2 + 1:g}s"]
    yield "gain", ["gain", "long.h5", "gained.h5", "--by", "0.3"]
    yield "import", ["import", "brought.wav", "brought.h5", "--unit", "V", "--layout", "4x4:11mm"]
    yield "import, peak", ["import", "brought.wav", "brought.h5", "--unit", "V", "--peak", "30Pa", "--force"]
    footprint = ["--channels", "0", "--footprint", "circle:20mm", "--turn", "again"]
    yield "import, footprint", ["import", "brought.wav", "field.h5", "--unit", "V", *footprint]
    for ending in ("wav", "npz", "mat"):
        yield f"export, {ending}", ["export", "long.h5", f"long.{ending}"]
    yield "calibrate", ["calibrate", "long.h5", "--sensitivity", "20mV/Pa"]
    yield "info, calibrated", ["info", "long.h5"]
    yield "compare", ["compare", "long.h5", "long.h5"]
    yield "solve a part", ["solve", "long.h5", "part.drive.h5", "--start-at", middle, "--duration", "0.05s"]
    cheapest = ["--method", "fast", "--guard", "0mm", "--fit", "points", "--rate", "1kHz"]
    yield "solve", ["solve", "long.h5", "solved.drive.h5", *cheapest]
    yield "info, drive", ["info", "long.drive.h5"]
    yield "play", ["play", "long.drive.h5"]
    yield "repair", ["repair", "killed.h5"]


_WEIGHED = """
import atexit, sys
from pathlib import Path
from midair.__main__ import main

def told():
    status = Path("/proc/self/status").read_text(encoding="ascii")
    Path("peak.txt").write_text(status.partition("VmHWM:")[2].split()[0], encoding="ascii")

atexit.register(told)
sys.argv[0] = "midair"
main()
"""


def weighed(words: list[str]) -> tuple[float, float, int]:
    """Peak in MB (10^6 bytes), seconds and exit status of `midair` with these arguments, in the current folder."""
    start = time.monotonic()
    with Path("said.txt").open("ab") as log:
        done = subprocess.run([sys.executable, "-c", _WEIGHED, *words], stdout=log, stderr=log, check=False, env=_ENV)
    return 1024 * int(Path("peak.txt").read_text(encoding="ascii")) / 1e6, time.monotonic() - start, done.returncode


_ENV = os.environ | {"OPENBLAS_NUM_THREADS": "1"}


def noise(first: int, last: int, rate: int) -> np.ndarray:
    """Noise with a slowly changing level as float32, shape (frame, 4, 4), in V; the same for any range of frames."""
    pattern = np.random.default_rng(0).standard_normal((rate, 4, 4))
    at = np.arange(first, last)
    swell = 0.1 + 0.05 * np.sin(2 * np.pi * 0.3 * at / rate)
    return (swell[:, None, None] * pattern[at % rate]).astype(np.float32).astype(np.float64)


def make_all(seconds: float) -> None:
    """Create all input files of the commands in the current folder."""
    make_recording(Path("long.h5"), seconds)
    make_drive(Path("long.drive.h5"), seconds)
    make_wav(Path("brought.wav"), seconds)


def make_recording(path: Path, seconds: float) -> None:
    """Create a recording, and the same recording as a killed writer would leave it."""
    from midair.files import RecordingWriter

    frames = round(seconds * RATE)
    samples = noise(0, frames, RATE)
    life = Provenance(source="noise", simulated=True)
    save(Recording(samples=samples, rate=RATE, provenance=life), path)
    child = os.fork()
    if child == 0:
        with RecordingWriter("killed.h5", rate=RATE, sensor=SensorGrid(), unit="V", provenance=life) as writer:
            for first in range(0, frames, 1000):
                writer.append(samples[first : first + 1000])
            os._exit(0)
    os.waitpid(child, 0)


def make_wav(path: Path, seconds: float) -> None:
    """Write the recording as an audio program would store it."""
    import soundfile

    frames = round(seconds * RATE)
    with soundfile.SoundFile(path, "w", RATE, 16, subtype="FLOAT", format="WAV") as file:
        for first in range(0, frames, RATE):
            block = noise(first, min(first + RATE, frames), RATE)
            file.write(block.reshape(len(block), 16).astype(np.float32))


def make_drive(path: Path, seconds: float) -> None:
    """Create drives with random phases, weak enough for any profile."""
    array = TransducerArray.autd3()
    frames = round(seconds * FRAME_RATE)
    rng = np.random.default_rng(1)
    phases = rng.uniform(0, 2 * np.pi, (64, array.count))

    def parts() -> Iterator[Solution]:
        for first in range(0, frames, 1000):
            count = min(1000, frames - first)
            drive = Drive(
                phase=phases[np.arange(first, first + count) % 64],
                level=np.full(count, 0.02),
                rate=FRAME_RATE,
                array=array,
                provenance=Provenance(source="random phases", simulated=True),
            )
            status = ("converged",) * count
            yield Solution(drive=drive, error=np.full(count, 0.1), iterations=np.ones(count, np.int64), status=status)

    save_solutions(parts(), path, frames=frames)


if __name__ == "__main__":
    main()
