import os
import signal
import threading

from midair.devices import END_SIGNALS, handle_signals


def test_a_signal_goes_to_the_handler_inside_and_to_the_old_one_outside():
    came = []
    before = signal.getsignal(signal.SIGTERM)
    with handle_signals(END_SIGNALS, lambda number, _: came.append(number)):
        os.kill(os.getpid(), signal.SIGTERM)
    assert came == [signal.SIGTERM]
    assert signal.getsignal(signal.SIGTERM) is before


def test_in_another_thread_nothing_changes():
    seen = []

    def run():
        before = signal.getsignal(signal.SIGTERM)
        with handle_signals(END_SIGNALS, lambda *_: None):
            seen.append(signal.getsignal(signal.SIGTERM) is before)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert seen == [True]
