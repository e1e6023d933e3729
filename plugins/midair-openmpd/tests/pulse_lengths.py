"""Effect of an OpenMPD board's seven phase bits and 64 pulse lengths on E; the README says how to run it.

A simulated stroke of a towel, at full pressure and at a tenth of it, is solved for one board at several levels. The
table has E of the drive; E of the output of a simulated board, with all transducers at the next shorter pulse as midair
plays it; and E with mixed pulse lengths, some one step longer than others, for the correct mean level.
"""

import argparse
import dataclasses

import numpy as np
from board_simulator import CommandReader, measured_board

from midair.datasets import stroke
from midair.devices import ExposureChoices, check_exposure
from midair.files import profile_named
from midair.model import AmplitudeFrames, Drive
from midair.physics import transfer_matrix
from midair.pipeline import reproduce
from midair.settings import paper_mode
from midair_openmpd import Board, OpenMpdArray, array_of_boards
from midair_openmpd.driver import START, STEPS, drive_frames

FRAMES = slice(100, 160)
ALWAYS = ExposureChoices(profile=profile_named("occupational-110"), override="the benchmark")


def main() -> None:
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    board = measured_board(3)
    touch = stroke("towel", duration=0.3)
    touch = dataclasses.replace(touch, pressure=touch.pressure[FRAMES])
    print("level   strength   E solved   E played   E if spread   loudest at an ear, dB")
    for gain, level in [(1.0, 1.0), (1.0, 0.5), (0.1, 1.0), (0.1, 0.5), (0.1, 0.2), (0.1, 0.1), (0.1, 0.05)]:
        made = reproduce(touch, array_of_boards(Board.nominal()), paper_mode().but(level=level, gain=gain))
        drive = made.solution.drive
        found = [
            made.solution.error.mean(),
            error(put_out(drive, board), made.target, drive),
            error(spread(drive, board), made.target, drive),
        ]
        loud = check_exposure(drive, OpenMpdArray(["nowhere"], [board]), ALWAYS).exposure.peak.max()
        cells = "".join(f"{100 * each:9.1f} %" for each in found)
        print(f"{level:5.2f}   {made.strength():8.3f} {cells}   {loud:10.1f}")


def put_out(drive: Drive, board: Board) -> np.ndarray:
    """Output of each transducer for the driver's bytes, shape (frame, transducer)."""
    seen = []
    CommandReader(seen.append).read(drive_frames(drive, 0, drive.frames, [board])[0])
    return np.array([one.sound()[board.pin] for one in seen]) * np.exp(1j * board.offset)


def spread(drive: Drive, board: Board) -> np.ndarray:
    """The same with a share of the transducers at the next longer pulse, always the same ones first."""
    first = np.random.default_rng(1).permutation(len(board.pin)) / len(board.pin)
    length = np.floor(np.arcsin(drive.level[:, None]) * STEPS / np.pi + first + 1e-9)
    start = np.rint((drive.phase - board.offset) / (2 * np.pi) * STEPS + (STEPS / 2 - length) / 2) % STEPS
    frames = np.empty((drive.frames, 2, len(board.pin)), np.uint8)
    frames[:, 0, board.pin], frames[:, 1, board.pin] = start, length
    frames[:, 0, 0] |= START
    seen = []
    CommandReader(seen.append).read(frames.tobytes())
    return np.array([one.sound()[board.pin] for one in seen]) * np.exp(1j * board.offset)


def error(q: np.ndarray, target: AmplitudeFrames, drive: Drive) -> float:
    matrix = transfer_matrix(target.grid, drive.array, acoustics=drive.acoustics)
    wanted = target.amplitude.reshape(drive.frames, -1)
    off = np.linalg.norm(np.abs(q @ matrix.T) - wanted, axis=1)
    return float((off / np.linalg.norm(wanted, axis=1)).mean())


if __name__ == "__main__":
    main()
