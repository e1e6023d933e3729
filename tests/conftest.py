import gc
import itertools
import os
import shutil
import signal
import sys

import pytest
from hypothesis import HealthCheck, settings
from tests.simulators.udp_proxy import UdpProxy

# Machines are noisy: a deadline would make the clock part of the law. The same examples each time, so that a red run
# stays red.
settings.register_profile(
    "midair", deadline=None, derandomize=True, max_examples=40, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("midair")


# Bytecode is kept, here and in the programs that tests start, also where the environment says otherwise: to compile it
# anew takes half of the time of a collection and a third of that of each `midair`.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A shell starts what runs in the background with Ctrl-C ignored; tests of it begin as a terminal would.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish():
    """The thousands of collected tests stay: the garbage collector need not look at them again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def _states(tmp_path_factory):
    """Names of folders that are made when somebody writes there; pytest makes each, and looks at all to name one."""
    folder = tmp_path_factory.mktemp("states")
    return (str(folder / str(number)) for number in itertools.count())


@pytest.fixture(autouse=True)
def _own_state(_states, monkeypatch):
    """Logs and lines of playing go to a folder of the test's own."""
    monkeypatch.setenv("MIDAIR_STATE", next(_states))


@pytest.fixture
def tap():
    """A proxy in front of four emulated units."""
    pytest.importorskip("autd3")
    one = UdpProxy(4)
    yield one
    one.close()


@pytest.fixture
def board():
    """A simulated OpenMPD board, which needs POSIX."""
    from tests.simulators.openmpd import OpenMpdSimulator

    one = OpenMpdSimulator()
    yield one
    one.close()


@pytest.fixture(scope="module")
def chromium():
    """The machine's own Chromium, driven from here."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright here")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium here")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield browser
        browser.close()
