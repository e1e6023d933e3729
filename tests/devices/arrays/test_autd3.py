import socket
import sys

import pytest

from midair.devices import autd3_array, pyautd3_array
from midair.devices.arrays.autd3 import SERVER_PORT, SIMULATOR_PORT, autd3_place
from midair.errors import MissingExtraError

WITHOUT = {
    "autd3": (autd3_array, "midair.devices.arrays.autd3_udp", "autd3"),
    "pyautd3": (lambda: pyautd3_array("audit"), "midair.devices.arrays.pyautd3_banks", "pyautd3"),
}


@pytest.mark.parametrize("extra", WITHOUT)
def test_a_missing_extra_is_an_error_when_the_device_opens(extra, monkeypatch):
    make, module, package = WITHOUT[extra]
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(MissingExtraError, match=rf'{package}.*pip install "midair\[{extra}\]"'):
        make().open()


PLACES = {
    "auto": ("auto", "autd3", False),
    "eth0": ("interface", "autd3:eth0", False),
    "emulator": ("emulator", "autd3:emulator", True),
    "[::1]:50000": ("address", "autd3:[::1]:50000", True),
    "[fe80::9:1]:44336": ("address", "autd3:[fe80::9:1]:44336", False),
    "[fe80::9:1%3]:44336": ("address", "autd3:[fe80::9:1%3]:44336", False),
    "simulator": ("simulator", "autd3-simulator:44336", True),
    "simulator:5000": ("simulator", "autd3-simulator:5000", True),
    "server": ("server", "autd3-server:44338", False),
    "server:5000": ("server", "autd3-server:5000", False),
    "server:localhost:5000": ("server", "autd3-server:5000", False),
    "server:[::1]:5000": ("server", "autd3-server:5000", False),
}


def test_places_by_their_names():
    places = {where: autd3_place(where) for where in PLACES}
    assert {where: (place.kind, place.device, place.simulated) for where, place in places.items()} == PLACES
    assert {where: (autd3_array(where).name, autd3_array(where).simulated) for where in PLACES} == {
        where: named[1:] for where, named in PLACES.items()
    }
    assert pyautd3_array("audit").simulated
    assert not pyautd3_array("ethercrab:eth0").simulated
    number, name = socket.if_nameindex()[0]
    assert autd3_place(f"[fe80::1%{name}]:5000").name == f"[fe80::1%{number}]:5000"


def test_the_ports_are_the_sdk_s_own():
    sdk = pytest.importorskip("autd3._autd3")
    assert (SIMULATOR_PORT, SERVER_PORT) == (sdk.SIMULATOR_PORT, sdk.SERVER_PORT)
