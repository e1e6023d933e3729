"""Await the result of a job on the event loop."""

import asyncio
from contextlib import suppress
from typing import Any

from midair.errors import InputError
from midair.studio.jobs import Jobs, StudioJob, Work


async def result_of(jobs: Jobs, title: str, work: Work, order: Any, *, first: bool = True) -> Any:
    """Add a job before the waiting ones and return its result; InputError with its message if it fails."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[Any] = loop.create_future()

    def settle(job: StudioJob) -> None:
        if done.done():
            return
        if job.state == "done":
            done.set_result(job.result)
        else:
            done.set_exception(InputError(job.error or f"{title}: {job.state}"))

    def ended(job: StudioJob) -> None:
        # The event loop may be closed by now.
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(settle, job)

    jobs.add(title, work, order, ended=ended, first=first)
    return await done
