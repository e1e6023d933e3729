"""OpenMPD frames against the board's own firmware (VHDL), simulated by GHDL from the reader's checkout.

``MIDAIR_OPENMPD=FOLDER`` names a checkout of RMResearch/OpenMPD_Hardware; Debian's package ghdl-mcode is needed.
Simulated: reading of commands, mapping of pins, memories, pulses. Not simulated: the serial link, the buffer of frames.
"""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from midair.model import Drive
from midair_openmpd import Board, array_of_boards
from midair_openmpd.driver import drive_frames

SOURCES = os.environ.get("MIDAIR_OPENMPD", "")
FILES = ["RSSFilter", "CommandReader", "PhaseCalibration", "PinMapping", "CalibrationAndMapping", "Counter"]
FILES += ["MuxPhase", "PulseWidthModulator", "AllChannels"]
GHDL = ["--std=08", "-frelaxed", "-fsynopsys"]
PERIOD, STEPS, FULL = 1024, 128, 64

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not SOURCES, reason="MIDAIR_OPENMPD names no checkout of OpenMPD_Hardware"),
    pytest.mark.skipif(not shutil.which("ghdl"), reason="no ghdl; on Debian: apt-get install ghdl-mcode"),
]


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    folder = tmp_path_factory.mktemp("openmpd")
    vhdl = Path(SOURCES) / "FPGA_3.4.2" / "src"
    files = [Path(__file__).with_name("openmpd_bench.vhd"), *(vhdl / f"{name}.vhd" for name in FILES)]
    # The memories first: the firmware names them; the bench names the firmware.
    ghdl("-i", *files, folder=folder)
    ghdl("-m", "bench", folder=folder)
    return folder


def ghdl(command, *names, folder):
    done = subprocess.run(["ghdl", command, *GHDL, *names], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def outputs(firmware, text):
    """Fundamental of each pin's pulses for the bytes of one frame; a pulse of half a turn has amplitude 1."""
    (firmware / "bytes.txt").write_text("\n".join(map(str, text)) + "\n", encoding="ascii")
    ghdl("-r", "bench", folder=firmware)
    rows = [line.split() for line in (firmware / "words.txt").read_text(encoding="ascii").splitlines()][:PERIOD]
    count = np.array([int(number) for number, _ in rows])
    bits = np.array([[digit == "1" for digit in reversed(word)] for _, word in rows])
    made = []
    # The words leave the chip some clocks after the count that they belong to; one of these delays is the right one.
    for delay in range(8):
        at = (count - delay) % PERIOD
        wave = np.zeros((8 * 32, STEPS))
        for step, slot, word in zip(at >> 3, at & 7, bits, strict=True):
            wave[np.arange(32) * 8 + slot, step] = word
        made.append(
            wave @ np.exp(2j * np.pi * np.arange(STEPS) / STEPS) / np.sum(np.exp(2j * np.pi * np.arange(FULL) / STEPS))
        )
    return np.array(made)


def errors(firmware, text, board, wanted):
    """Largest error of phase in steps, for levels above 0.2; least and largest error of amplitude."""
    got = outputs(firmware, text)[:, board.pin]
    best = got[np.argmin(np.abs(got - wanted).mean(1))]
    loud, amplitude = np.abs(wanted) > 0.2, np.abs(best) - np.abs(wanted)
    return np.abs(np.angle(best[loud] / wanted[loud])).max() * STEPS / (2 * np.pi), amplitude.min(), amplitude.max()


@pytest.mark.parametrize("seed", [1, 2])
def test_both_boards_sound_as_the_drive_says(firmware, seed):
    boards = [Board.nominal(), Board.nominal()]
    array, rng = array_of_boards(*boards), np.random.default_rng(seed)
    phase, level = rng.uniform(0, 2 * np.pi, (2, array.count)), rng.uniform(0, 1, (2, array.count))
    drive = Drive(phase=phase, level=level, rate=1000.0, array=array)
    for number, text in enumerate(drive_frames(drive, 1, 1, boards)):
        own = slice(256 * number, 256 * (number + 1))
        step, least, greatest = errors(firmware, text, boards[number], level[1, own] * np.exp(1j * phase[1, own]))
        # The beginning of a pulse is rounded once. Its length is rounded down, a step is up to 2.5 % of full drive.
        assert step <= 0.51
        assert -0.0255 < least < -0.01
        assert greatest <= 0.0003


def test_the_bench_tells_a_wrong_phase(firmware):
    board = Board.nominal()
    array, rng = array_of_boards(board), np.random.default_rng(3)
    phase = rng.uniform(0, 2 * np.pi, (1, array.count))
    drive = Drive(phase=phase, level=np.ones((1, array.count)), rate=1000.0, array=array)
    (text,) = drive_frames(drive, 0, 1, [board])
    phase[0, 17] += 0.3
    assert errors(firmware, text, board, np.exp(1j * phase[0]))[0] > 5
