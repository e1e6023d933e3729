import sys

import pytest

from midair.devices import autd3_array, pyautd3_array
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


def test_names_state_the_kind_of_device():
    assert (autd3_array().name, autd3_array().simulated) == ("autd3", False)
    assert (autd3_array("eth0").name, autd3_array("eth0").simulated) == ("autd3:eth0", False)
    assert (autd3_array("emulator").name, autd3_array("emulator").simulated) == ("autd3:emulator", True)
    assert autd3_array("[::1]:50000").simulated
    assert (autd3_array("[fe80::1%2]:44336").name, autd3_array("[fe80::1%2]:44336").simulated) == (
        "autd3:[fe80::1%2]:44336",
        False,
    )
    assert pyautd3_array("audit").simulated
    assert not pyautd3_array("ethercrab:eth0").simulated
