"""`pytest -p tests.hidden`: run tests as on a machine without PortAudio, sound servers and Chromium."""

import ctypes.util
import shutil

LIBRARIES = {"portaudio", "jack", "jackserver"}
PROGRAMS = {"jackd", "pulseaudio", "chromium", "chromium-browser", "google-chrome"}

_library, _program = ctypes.util.find_library, shutil.which


def _find_library(name):
    return None if name in LIBRARIES else _library(name)


def _which(cmd, *rest, **more):
    return None if cmd in PROGRAMS else _program(cmd, *rest, **more)


ctypes.util.find_library, shutil.which = _find_library, _which
