import pytest

from midair.errors import DeviceStateError
from midair.studio.control import Control


@pytest.fixture
def control():
    sounding = [False]
    made = Control(sounding=lambda: sounding[0])
    made.enter(1)
    made.enter(2)
    return made, sounding


def test_the_first_page_has_control_and_the_second_looks_on(control):
    control, _ = control
    control.check(1)
    with pytest.raises(DeviceStateError, match="another page has control"):
        control.check(2)


def test_in_silence_any_page_may_take_over(control):
    control, _ = control
    assert control.take(2)
    with pytest.raises(DeviceStateError):
        control.check(1)


def test_while_something_sounds_only_the_holder_gives_it_away(control):
    control, sounding = control
    sounding[0] = True
    assert not control.take(2)
    control.check(1)
    with pytest.raises(DeviceStateError, match="this page may only watch"):
        control.give(2, to=2)
    control.give(1, to=2)
    control.check(2)


def test_the_holder_may_keep_it(control):
    control, sounding = control
    sounding[0] = True
    control.take(2)
    control.refuse(1)
    with pytest.raises(DeviceStateError, match="requests it"):
        control.give(1, to=2)


def test_nobody_has_control_after_its_page_went_until_somebody_takes_it(control):
    control, sounding = control
    assert control.leave(1)
    with pytest.raises(DeviceStateError, match="no page has control"):
        control.check(2)
    sounding[0] = True
    assert control.take(2)


def test_who_asked_and_went_is_not_given_it(control):
    control, sounding = control
    sounding[0] = True
    control.take(2)
    assert not control.leave(2)
    with pytest.raises(DeviceStateError):
        control.give(1, to=2)
