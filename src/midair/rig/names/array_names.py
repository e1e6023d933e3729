"""Arrays by name: ``autd3:eth0``, ``pyautd3:audit``, ``openmpd:COM3``."""

from collections.abc import Callable
from typing import Literal

from midair.devices import ArrayDevice, OpenMpdArray, SilencerChoice, autd3_array, pyautd3_array
from midair.errors import InputError, UnknownDeviceError
from midair.files import load_board
from midair.model import Board, Placement, TransducerArray, array_of_boards
from midair.registry import Registry
from midair.rig.names.sensor_names import split_name

NAMES = (
    "virtual, autd3, autd3:INTERFACE, autd3:emulator, autd3-simulator, autd3-server, pyautd3, pyautd3:INTERFACE, "
    "pyautd3:twincat, pyautd3:remote:ADDRESS:PORT, pyautd3:audit, pyautd3:nop or openmpd:PORT[,PORT]?board=FILE[,FILE]"
)

ARRAYS: Registry[Callable[[str, Placement | None, SilencerChoice], ArrayDevice]] = Registry(
    "midair.arrays",
    {
        "autd3": "midair.rig.names.array_names:open_autd3",
        "autd3-simulator": "midair.rig.names.array_names:open_autd3",
        "autd3-server": "midair.rig.names.array_names:open_autd3",
        "pyautd3": "midair.rig.names.array_names:open_pyautd3",
        "openmpd": "midair.rig.names.array_names:open_openmpd",
    },
)
"""Functions that make an array, by the part of its name before the colon: name, placement, silencer to device."""

ArrayKind = Literal["autd3", "openmpd", "openmpd-twin"]
"""Arrays that the solver supports without a file: two by two units, one board, two opposing boards."""


def array_of_kind(kind: ArrayKind) -> TransducerArray:
    """Transducers of a kind of array."""
    if kind == "autd3":
        return TransducerArray.autd3()
    return array_of_boards(*[Board.nominal()] * (1 if kind == "openmpd" else 2))


def array_named(name: str, placement: Placement | None = None, *, silencer: SilencerChoice = "auto") -> ArrayDevice:
    """Make the array that a name stands for, not yet open.

    ``autd3`` searches all network interfaces; ``autd3:INTERFACE`` uses one, or the address of an emulator;
    ``autd3:emulator`` starts one. ``autd3-simulator`` and ``autd3-server``, with ``:PORT`` if not the default, are the
    makers' programs on this computer. ``pyautd3`` and ``pyautd3:INTERFACE`` are for older firmware over EtherCAT,
    ``pyautd3:twincat`` and ``pyautd3:remote:ADDRESS:PORT`` for a server; ``pyautd3:audit`` and ``pyautd3:nop`` have no
    hardware. ``openmpd:PORT?board=FILE`` is a board at a serial port with its own file,
    ``openmpd:LOWER,UPPER?board=FILE,FILE`` two of them; ``board=none`` stands for a board without a file. Without
    ``board=`` a board can be silenced, but not played on. ``virtual`` is made by `VirtualRig` instead.

    Without a placement the units are two by two; boards of openmpd have a fixed one. UnknownDeviceError if the name is
    unknown, InputError if an option is unknown or does not fit, FileError if a board's file cannot be read.
    """
    if name == "virtual":
        raise UnknownDeviceError("array: expected a real array or an emulator, got virtual, which needs no driver")
    kind, colon, place = name.partition(":")
    if (colon and not place) or kind not in ARRAYS:
        others = "".join(f"{each}:PLACE, " for each in ARRAYS.others)
        raise UnknownDeviceError(f"array: expected {others}{NAMES}, got {name!r}")
    return ARRAYS[kind](name, placement, silencer)


def open_autd3(name: str, placement: Placement | None, silencer: SilencerChoice) -> ArrayDevice:
    """AUTD3 units by the current SDK; ``autd3-simulator`` and ``autd3-server`` are programs of the makers."""
    place = name.removeprefix("autd3").removeprefix("-").removeprefix(":")
    return autd3_array(place or "auto", placement, silencer=silencer)


def open_pyautd3(name: str, placement: Placement | None, silencer: SilencerChoice) -> ArrayDevice:
    """AUTD3 units by the SDK for older firmware."""
    where = name.partition(":")[2]
    if where not in ("audit", "nop", "twincat") and not where.startswith("remote:"):
        # Any other text is the name of a network interface.
        where = f"ethercrab:{where}" if where else "ethercrab"
    return pyautd3_array(where, placement, silencer=silencer)


def open_openmpd(name: str, placement: Placement | None, silencer: SilencerChoice) -> OpenMpdArray:
    """OpenMPD boards at their serial ports."""
    _, where, said = split_name(name)
    if not where:
        raise UnknownDeviceError(f"array: expected {NAMES}, got {name!r}")
    if placement is not None:
        raise InputError(f"{name}: expected no placement, got one; boards are single, or opposing at 238.8 mm")
    if unknown := sorted(set(said) - {"board"}):
        raise InputError(f"{name}: expected the option board, got {unknown[0]}")
    # In the order of the ports; none without the option.
    files = said["board"].split(",") if "board" in said else []
    boards = [Board.nominal() if file == "none" else load_board(file) for file in files]
    return OpenMpdArray(where.split(","), boards, name=f"openmpd:{where}", silencer=silencer)
