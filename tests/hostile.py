"""A folder of a stranger: it has modules that leave a mark when a program imports them."""

NAMES = ("multiprocessing", "numpy", "json", "sitecustomize", "h5py", "distributed", "runpy")
"""Modules of this name are imported by child processes, or before a program of Python begins."""


def hostile_folder(folder, marks):
    """Write the modules, and a package `midair` that can be run; `marks` is the file for the marks."""
    (folder / "midair").mkdir()
    for name in (*NAMES, "midair/__init__", "midair/__main__"):
        (folder / f"{name}.py").write_text(f"open({str(marks)!r}, 'a').write({name!r} + '\\n')\n")
