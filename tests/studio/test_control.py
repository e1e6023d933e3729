import pytest

from midair.errors import DeviceStateError
from midair.studio.studio_state import Control


@pytest.fixture
def control():
    sounding = [False]
    made = Control(sounding=lambda: sounding[0])
    made.enter(1)
    made.enter(2)
    return made, sounding


def test_only_the_holder_can_give_control_while_playing(control):
    control, sounding = control
    sounding[0] = True
    # A page that requested and left, and one that is refused, do not get it.
    for ends in (lambda: control.refuse(1), lambda: control.leave(2)):
        assert not control.take(2)
        ends()
        with pytest.raises(DeviceStateError, match="requests it"):
            control.give(1, to=2)
    control.enter(2)
    assert not control.take(2)
    control.check(1)
    with pytest.raises(DeviceStateError, match="this page may only watch"):
        control.give(2, to=2)
    control.give(1, to=2)
    control.check(2)


def test_control_is_free_after_its_page_has_left(control):
    control, sounding = control
    control.leave(1)
    with pytest.raises(DeviceStateError, match="no page has control"):
        control.check(2)
    sounding[0] = True
    assert control.take(2)
