"""Arrays by the names that people give them on the command line: ``autd3:eth0``, ``pyautd3:audit``."""

from midair.devices import BankedArray, SilencerChoice, autd3_array, pyautd3_array
from midair.errors import UnknownDeviceError
from midair.model import Placement

NAMES = (
    "virtual, autd3, autd3:INTERFACE, autd3:emulator, pyautd3, pyautd3:INTERFACE, pyautd3:twincat, "
    "pyautd3:remote:ADDRESS:PORT, pyautd3:audit or pyautd3:nop"
)


def array_named(name: str, placement: Placement | None = None, *, silencer: SilencerChoice = "auto") -> BankedArray:
    """The array that a name means, not yet open.

    Parameters
    ----------
    name : str
        ``autd3`` searches all network interfaces; ``autd3:INTERFACE`` takes one, or the address of an emulator;
        ``autd3:emulator`` starts one. ``pyautd3`` and ``pyautd3:INTERFACE`` are for older firmware over
        EtherCAT, ``pyautd3:twincat`` and ``pyautd3:remote:ADDRESS:PORT`` through a server; ``pyautd3:audit`` and
        ``pyautd3:nop`` have no hardware behind them. ``virtual`` is not among them: it needs a skin to press on.
    placement : Placement, optional
        Placement of the units; two by two if None.
    silencer : {"auto", "off", "quarter", "half", "default"}
        How phase steps are spread.

    Raises
    ------
    UnknownDeviceError
        If nothing answers to the name.
    """
    kind, colon, where = name.partition(":")
    if colon and not where:
        kind = ""
    match kind:
        case "autd3":
            return autd3_array(where or "auto", placement, silencer=silencer)
        case "pyautd3":
            return pyautd3_array(_old_link(where), placement, silencer=silencer)
        case _:
            raise UnknownDeviceError(f"array: expected {NAMES}, got {name!r}")


def _old_link(where: str) -> str:
    """The link that follows ``pyautd3:``; whatever is none is a network interface."""
    if where in ("audit", "nop", "twincat") or where.startswith("remote:"):
        return where
    return f"ethercrab:{where}" if where else "ethercrab"
