"""Do many jobs with workers that may die, here or on a cluster."""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass
from typing import Generic, TypeVar

from serpent_twin.errors import SerpentError

Job = TypeVar("Job")
Result = TypeVar("Result")

_TICK = 1.0  # [s] between looks at the clock


@dataclass
class Pool:
    """Workers behind any executor."""

    open: Callable[[], Executor]
    """A new executor, also after the former broke"""
    slots: Callable[[], int]
    """How many jobs the workers do at once"""
    died: tuple[type[BaseException], ...] = (BrokenExecutor,)
    """What a job raises whose worker died"""
    retries: int = 3
    """How often such a job is tried again"""

    def __post_init__(self) -> None:
        self._executor = self.open()

    def submit(self, work: Callable[[Job], Result], job: Job) -> "Future[Result]":
        """Hand out a job, to new workers if the former broke."""
        try:
            return self._executor.submit(work, job)
        except BrokenExecutor:
            self._executor = self.open()
            return self._executor.submit(work, job)

    def close(self, wait: bool) -> None:
        """Let the workers go, after their jobs or at once."""
        self._executor.shutdown(wait=wait)


class _Desk(Generic[Job, Result]):
    """Hands jobs out, no more at a time than there are slots, and takes them back."""

    def __init__(self, jobs: Sequence[Job], work: Callable[[Job], Result], pool: Pool) -> None:
        self._work, self._pool = work, pool
        self._waiting, self._deaths = deque(jobs), Counter[Job]()
        self._running: dict[Future[Result], Job] = {}
        self.given_up: list[Job] = []
        self.error: Exception | None = None
        """The first that a job raised; no job is handed out after it"""

    def hand_out(self) -> bool:
        """Fill the slots; False when nothing is left to do."""
        while self._waiting and not self.error and self._room():
            job = self._waiting.popleft()
            self._running[self._pool.submit(self._work, job)] = job
        return bool(self._running)

    def _room(self) -> bool:
        """Whether a slot is free. A broken worker loses all jobs; a job that broke one is retried alone."""
        suspect = any(self._deaths[job] for job in [self._waiting[0], *self._running.values()])
        return len(self._running) < (1 if suspect else self._pool.slots())

    def take_back(self, keep: Callable[[Job, Result], None]) -> None:
        """Wait a moment for jobs that are done, and keep what they give."""
        for future in wait(self._running, _TICK, FIRST_COMPLETED).done:
            job = self._running.pop(future)
            try:
                result = future.result()
            except self._pool.died:
                self._put_back(job)
            except CancelledError:
                raise
            except Exception as error:  # raised once the other jobs at work are done
                self.error = self.error or error
            else:
                keep(job, result)

    def _put_back(self, job: Job) -> None:
        self._deaths[job] += 1
        again = self._deaths[job] <= self._pool.retries
        (self._waiting if again else self.given_up).append(job)


def execute(
    jobs: Sequence[Job],
    work: Callable[[Job], Result],
    pool: Pool,
    keep: Callable[[Job, Result], None],
    tick: Callable[[], object] = lambda: None,
) -> list[Job]:
    """Do all jobs, in any order; `keep` is given each result, here, as soon as it is there.

    Returns the jobs that were given up, because each worker that tried them died. After an error of a job
    no further one begins; those at work are finished and kept, then the error is raised. `tick` is called
    about once a second. Raises SerpentError when the workers are lost for good.
    """
    desk = _Desk(jobs, work, pool)
    try:
        while desk.hand_out():
            desk.take_back(keep)
            tick()
    except CancelledError as error:
        raise SerpentError(
            "The workers were lost, and with them the points in flight. What was measured stays; the same "
            "command goes on from there."
        ) from error
    if desk.error:
        raise desk.error
    return desk.given_up
