"""A program that runs midair in child processes and kills them. Run by tests.

Reads lines of JSON {"words": [...], "after": seconds or null}; for each it prints {"status": what it ended with, or -9,
"lasted": seconds}. What it runs is forked, so that a kill after some hundredths of a second hits work and no imports.
"""

import json
import os
import signal
import sys
import time

from midair.cli import run
from midair.study import analyse, data_of_columns, report_page


def warm():
    frame = {"participant": list("aabb"), "shown": list("xyxy"), "said": list("xyyx")}
    report_page(
        analyse(data_of_columns(frame, participant="participant", presented="shown", answered="said"), draws=5),
        title="",
    )


def child(words):
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    os._exit(run(words))


warm()
print("ready", flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    begin = time.monotonic()
    process = os.fork()
    if process == 0:
        child(asked["words"])
    if asked["after"] is not None:
        time.sleep(asked["after"])
        os.kill(process, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    print(json.dumps({"status": status, "lasted": time.monotonic() - begin}), flush=True)
