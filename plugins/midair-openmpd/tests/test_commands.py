"""OpenMPD boards as a person types them: solve for them, play on stand-ins, and the field that comes of it."""

import subprocess
import sys

import numpy as np
import pytest
from board_simulator import OpenMpdSimulator, measured_board
from tests.cli.conftest import _own_folder as _own_folder
from tests.drives import save_drive
from tests.waiting import wait_until

from midair.cli import run
from midair.files import load_solution, load_target
from midair.physics import focus_phase, quantise_phase, transfer_matrix
from midair_openmpd import Board, array_of_boards

pytestmark = pytest.mark.usefixtures("own_state")


def write_board(path, board):
    degrees = np.rint(np.degrees(board.offset)).astype(int)
    lists = [
        "".join(f"({x:f}, {y:f}, {z:f})," for x, y, z in board.position),
        *("".join(f"{each}," for each in values) for values in (board.pin, degrees, board.strength)),
    ]
    path.write_text("\n".join([board.serial, "256", "128", *lists, ""]), encoding="ascii")
    return path


def solved(path, *words):
    """A felt stroke solved for, 30 frames."""
    assert run(["record", "virtual:towel", "towel.h5", "--duration", "0.3s"]) == 0
    part = "--start-at 100ms --duration 30ms --lead 0s --mode paper"
    assert run(["solve", "towel.h5", str(path), *part.split(), *words]) == 0
    return load_solution(path)


FEW = ["--set", "target.grid.rows=6", "--set", "target.grid.columns=6", "--set", "target.grid.pitch=0.011"]


def errors(drive, target, q):
    matrix = transfer_matrix(target.grid, drive.array, acoustics=drive.acoustics)
    wanted = target.amplitude.reshape(drive.frames, -1)
    return np.linalg.norm(np.abs(q @ matrix.T) - wanted, axis=1) / np.linalg.norm(wanted, axis=1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("count", "words"),
    # Strong targets: what seven bits of phase leave over is then small beside them.
    [(1, ["--gain", "16"]), (2, ["--gain", "64", "--height", "119.4mm"])],
    ids=["one board", "face to face"],
)
def test_the_output_of_the_boards_is_the_solved_field(count, words, tmp_path, capsys):
    boards, ports = [measured_board(number) for number in range(count)], [OpenMpdSimulator() for _ in range(count)]
    files = [write_board(tmp_path / f"board_{number}.pat", board) for number, board in enumerate(boards)]
    device = f"openmpd:{','.join(port.port for port in ports)}?board={','.join(map(str, files))}"
    solution = solved(tmp_path / "x.drive.h5", "--device", device, *words)
    played = run(["play", "x.drive.h5", "--device", device, "--override-exposure", "A Person"])
    printed = " ".join(capsys.readouterr().out.split())
    for port in ports:
        port.settle()
        port.close()
    assert played == 0, printed
    assert " on openmpd:" in printed
    assert not any(port.sounds for port in ports)
    drive, target = solution.drive, load_target("x.drive.h5")
    assert drive.array.count == 256 * count
    heard = [
        np.array([one.sound()[board.pin] for one in port.heard]) * np.exp(1j * board.offset)
        for port, board in zip(ports, boards, strict=True)
    ]
    q = np.concatenate(heard, axis=1)
    assert np.abs(np.angle(q * drive.q.conj())).max() <= np.pi / 128 + 1e-9
    rounded = errors(drive, target, np.exp(1j * quantise_phase(drive.phase, bits=7)))
    played = errors(drive, target, q)
    assert played.mean() == pytest.approx(rounded.mean(), abs=0.01)
    assert played.mean() <= solution.error.mean() + 0.03


def test_a_loud_drive_is_refused_before_the_board_is_opened(board, capsys):
    array = array_of_boards(Board.nominal())
    save_drive("x.drive.h5", np.tile(focus_phase(array, np.array([0, 0, 0.12])), (2, 1)), 1.0, array=array)
    assert run(["play", "x.drive.h5", "--device", f"openmpd:{board.port}?board=none"]) == 1
    assert "limit 110 dB" in capsys.readouterr().err
    board.settle()
    assert len(board.frames) == 1


def test_a_drive_for_another_array_is_refused(board, capsys):
    save_drive("x.drive.h5")
    assert run(["play", "x.drive.h5", "--device", f"openmpd:{board.port}?board=none"]) == 1
    assert "expected one for OpenMPD (256 transducers), got one for AUTD3 2 x 2" in capsys.readouterr().err
    assert board.heard == []


def test_stop_silences_a_board_that_something_left_sounding(board, capsys):
    with open(board.port, "wb", buffering=0) as line:
        line.write(bytes([0x80] + [0] * 255 + [64] * 256))
        board.settle()
        assert board.sounds
        assert run(["stop", "--device", f"openmpd:{board.port}"]) == 0
    board.settle()
    assert not board.sounds
    assert "opened and silenced" in capsys.readouterr().out


@pytest.mark.long
def test_stop_in_another_terminal_is_true_when_it_answers(board, capsys):
    device = f"openmpd:{board.port}?board=none"
    solved("x.drive.h5", "--device", device, *FEW)
    words = ["play", "x.drive.h5", "--device", device, "--repeats", "2000"]
    order = [sys.executable, "-m", "midair", *words, "--override-exposure", "A Person"]
    player = subprocess.Popen(order, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        wait_until(lambda: board.sounds)
        assert board.sounds, player.communicate()
        capsys.readouterr()
        assert run(["stop"]) == 0
        assert "silent" in capsys.readouterr().out
        board.settle()
        count = len(board.heard)
        assert not board.sounds
        _, said = player.communicate(timeout=60)
        assert player.returncode != 0
        assert "silenced by midair stop" in said
        board.settle()
        assert len(board.heard) == count
    finally:
        player.kill()
        player.communicate()


@pytest.mark.long
def test_doctor_reports_what_it_cannot_check(board, capsys):
    run(["doctor", "--device", f"openmpd:{board.port}", "--json"])
    said = " ".join(capsys.readouterr().out.split())
    assert "its last frame forever" in said
    assert board.heard == []
