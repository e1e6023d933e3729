import io
import os
import signal

import pytest

from midair.cli.keys import Keys, signals_noted

termios = pytest.importorskip("termios", reason="terminals of POSIX")


def test_keys_come_without_enter_and_the_terminal_is_as_before_also_after_an_error():
    master, slave = os.openpty()
    with os.fdopen(slave, "r") as stream:
        before = termios.tcgetattr(stream)
        with Keys(stream) as keys:
            assert (keys.active, keys.pressed()) == (True, "")
            os.write(master, "qä ".encode())
            assert (keys.pressed(), keys.pressed()) == ("qä ", "")
        assert not keys.active

        def fail():
            with Keys(stream):
                assert termios.tcgetattr(stream) != before
                raise ValueError("the sensor went away")

        with pytest.raises(ValueError, match="went away"):
            fail()
        assert termios.tcgetattr(stream) == before
    os.close(master)


def test_without_a_terminal_there_are_no_keys():
    for stream in (io.StringIO("q"), open(os.devnull)):  # noqa: SIM115
        with stream, Keys(stream) as keys:
            assert (keys.active, keys.pressed()) == (False, "")


def test_a_signal_is_noted_and_ends_nothing_but_a_second_ctrl_c_is_not_waited_for():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        before = signal.getsignal(number)
        with signals_noted() as signals:
            assert signals.came == ""
            os.kill(os.getpid(), number)
            assert signals.came == number.name
        assert signal.getsignal(number) is before
    with pytest.raises(KeyboardInterrupt), signals_noted():
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
