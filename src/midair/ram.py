"""Available memory, and the return of freed memory to the system."""

import ctypes
import re
import sys
from pathlib import Path


def available_memory(meminfo: Path = Path("/proc/meminfo"), group: Path = Path("/sys/fs/cgroup")) -> int | None:
    """Bytes that a process can allocate without swapping, also within a cgroup; None where this is unknown."""
    if not meminfo.is_file():
        return None
    found = re.search(r"^MemAvailable:\s+(\d+) kB", meminfo.read_text(encoding="ascii"), re.MULTILINE)
    free = None if found is None else 1024 * int(found[1])
    limit, used = (_number(group / name) for name in ("memory.max", "memory.current"))
    if limit is None or used is None:
        return free
    # The page cache counts as used there, but the kernel frees it on demand.
    kept = _number(group / "memory.stat", r"^inactive_file (\d+)$") or 0
    left = max(limit - used + kept, 0)
    return left if free is None else min(free, left)


def address_limit() -> int | None:
    """Address space that this process may use, in bytes (``ulimit -v``); None if unlimited."""
    try:
        import resource
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def return_large_arrays(least: int = 2**22) -> bool:
    """Return arrays of `least` bytes or more to the system as soon as they are freed; True if that could be set.

    The default threshold of the GNU C library rises with freed sizes up to 32 MB; smaller arrays come from a heap that
    small live objects keep from shrinking, so that streaming large blocks grows the process by half.
    """
    if sys.platform != "linux":
        return False
    # mallopt(3); other C libraries lack this function.
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    # M_MMAP_THRESHOLD (-3), which also freezes M_TRIM_THRESHOLD (-1) at 128 KiB unless that is set: then the heap of
    # small arrays would be returned after each step of a solver, and its pages fetched again.
    return mallopt is not None and all(bool(mallopt(name, size)) for name, size in ((-3, least), (-1, 2**27)))


def _number(path: Path, pattern: str = r"^(\d+)$") -> int | None:
    found = re.search(pattern, path.read_text(encoding="ascii"), re.MULTILINE) if path.is_file() else None
    return None if found is None else int(found[1])
