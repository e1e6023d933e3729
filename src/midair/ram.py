"""How much memory the system can still give, and that it gets back what is no longer used."""

import ctypes
import re
import sys
from pathlib import Path


def available(meminfo: Path = Path("/proc/meminfo"), group: Path = Path("/sys/fs/cgroup")) -> int | None:
    """Bytes that a process can take before something is swapped out or killed; None where nobody says.

    Linux says it, and within a container how much its group may have.
    """
    if not meminfo.is_file():
        return None
    said = re.search(r"^MemAvailable:\s+(\d+) kB", meminfo.read_text(encoding="ascii"), re.MULTILINE)
    free = None if said is None else 1024 * int(said[1])
    limit, used = (_number(group / name) for name in ("memory.max", "memory.current"))
    if limit is None or used is None:
        return free
    # What files left in memory counts as used there, but is given back when it is asked for.
    kept = _number(group / "memory.stat", r"^inactive_file (\d+)$") or 0
    left = max(limit - used + kept, 0)
    return left if free is None else min(free, left)


def give_back_large(least: int = 2**22) -> bool:
    """From now on an array of `least` bytes or more goes back to the system as soon as nobody has it; whether so.

    The GNU library's own choice rises with what was freed, up to 32 MB; arrays below that are cut out of one heap, of
    which small ones that stay keep the rest. What streams large blocks then grows by half without holding more.
    """
    if sys.platform != "linux":
        return False
    # mallopt(3): parameter -3 is M_MMAP_THRESHOLD; other C libraries have no such function.
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    return mallopt is not None and bool(mallopt(-3, least))


def _number(path: Path, pattern: str = r"^(\d+)$") -> int | None:
    said = re.search(pattern, path.read_text(encoding="ascii"), re.MULTILINE) if path.is_file() else None
    return None if said is None else int(said[1])
