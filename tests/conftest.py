import contextlib
import gc
import itertools
import os
import shutil
import signal
import sys
import time

import pytest

# Bytecode is kept, here and in the programs that tests start, also where the environment says otherwise: to compile it
# anew takes half of the time of a collection and a third of that of each `midair`.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A shell starts what runs in the background with Ctrl-C ignored; tests of it begin as a terminal would.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure():
    """No deadline, for machines are noisy; the same examples each time, so that a red run stays red."""
    from hypothesis import HealthCheck, settings  # here: its bytecode is kept from now on

    settings.register_profile(
        "midair", deadline=None, derandomize=True, max_examples=15, suppress_health_check=[HealthCheck.too_slow]
    )
    settings.load_profile("midair")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """The thousands of collected tests stay: the garbage collector need not look at them, neither now nor later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def _states(tmp_path_factory):
    """Names of folders that are made when somebody writes there; pytest makes each, and looks at all to name one."""
    folder = tmp_path_factory.mktemp("states")
    return (str(folder / str(number)) for number in itertools.count())


@pytest.fixture(autouse=True)
def _own_state(_states, monkeypatch):
    """Logs and lines of playing go to a folder of the test's own."""
    monkeypatch.setenv("MIDAIR_STATE", next(_states))


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Return the folder of a name, which `fill` fills in one worker; the others wait until it has."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def made(name, fill):
        folder, part = shared / name, shared / f"{name}.part"
        while not folder.exists():
            try:
                part.mkdir()
            except FileExistsError:
                time.sleep(0.05)
                continue
            try:
                if not folder.exists():  # the one before may have ended in between
                    fill(part)
                    part.rename(folder)
            finally:
                shutil.rmtree(part, ignore_errors=True)
        return folder

    return made


@pytest.fixture(scope="session")
def take_file(made_once):
    """0.7 s of the virtual towel, to read alone: a test that changes or plays it copies it."""

    def fill(folder):
        from midair.cli import run

        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            assert run(["record", "virtual:towel", str(folder / "towel.h5"), "--duration", "0.7s"]) == 0

    return made_once("towel", fill) / "towel.h5"


@pytest.fixture(scope="session")
def live_kernel(made_once):
    """The compiled loops of the live solver: one worker compiles them for ten seconds, the others load its file."""
    pytest.importorskip("numba")

    def fill(folder):
        import numpy as np

        from midair.solvers import Problem
        from midair.solvers.live import Live

        G = np.random.default_rng(0).normal(size=(3, 8)) + 0j
        Live().begin(Problem(G=G, amplitude=np.ones((1, 3)), psi=np.zeros(3), position=np.zeros((8, 3))))

    made_once("live_kernel", fill)


@pytest.fixture
def tap():
    """A proxy in front of four emulated units."""
    pytest.importorskip("autd3")
    from tests.simulators.udp_proxy import UdpProxy

    one = UdpProxy(4)
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
