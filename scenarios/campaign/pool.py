"""Processes that fly jobs, each job in one of them, whatever becomes of the process.

A process that dies takes nothing with it but its job, which is given to another once: memory may have run out by what
else was going on. A job whose process dies a second time is done, and its error says how. So is one that takes longer
than it may.
"""

import multiprocessing
import os
import pickle
import signal
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from multiprocessing.resource_tracker import ensure_running
from types import TracebackType
from typing import Self

from dockair.errors import DockairError
from dockair.scenarios.campaign.jobs import Job
from dockair.scenarios.campaign.worker import READY, Answer, Order, work

DEATHS_OF_A_JOB = 2
FLIGHTS_OF_A_PROCESS = 25  # then another begins: what libraries do not give back of the memory, the system takes
_START_S = 300.0  # for a process to import what it needs, however slow the disk
_TICK_S = 0.5  # between two looks at the clock
_LEAVE_S = 5.0  # for an idle process to end by itself

#: Libraries that would start a thread a core in every process; the cores are all taken already.
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "LP_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Done:
    """What came of a job."""

    job: Job
    answer: Answer


class _Worker:
    """A process and its job."""

    def __init__(self, flight: str) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection: Connection
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=work, args=(theirs, flight), daemon=True)
        ensure_running()  # its own start would let the signal through again
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: Ctrl-C is for us alone
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()  # so that its death is the end of the file here
        self.job: Job | None = None
        self.begun_s, self.flown, self._ready = 0.0, 0, False

    def take(self, job: Job) -> None:
        self.job, self.begun_s = job, time.monotonic()
        try:
            self.connection.send(Order(seed=job.seed, key=job.key, pickled=pickle.dumps(job)))
        except (BrokenPipeError, ConnectionResetError):
            pass  # it has died; that is seen when its answer is asked for

    def answer(self) -> Answer | None:
        """Return what it has answered, None if nothing; a dead process raises EOFError."""
        try:
            if not self.connection.poll():
                return None
            said: Answer | str = self.connection.recv()
        except OSError:
            raise EOFError from None
        if said == READY:
            self._ready, self.begun_s = True, time.monotonic()
            return None
        if isinstance(said, str):
            raise DockairError("campaign", expected="a function that flies an order", got=said)
        return said

    def is_late(self, timeout_s: float) -> bool:
        """Whether it has had its job for too long."""
        return time.monotonic() - self.begun_s > (timeout_s if self._ready else max(timeout_s, _START_S))

    def end(self, *, at_once: bool) -> None:
        if at_once:
            self.process.kill()
        else:
            try:
                self.connection.send(None)
            except OSError:
                pass
        self.process.join(_LEAVE_S)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        self.connection.close()


class Pool:
    """Some processes; use it in a `with` statement.

    Args:
        workers: how many at most.
        timeout_s: wall time that a job may take.
        flight: "module:function" from an order to the columns of its row.
        check: called before a process begins; what it raises ends the campaign.
    """

    def __init__(self, workers: int, timeout_s: float, flight: str, check: Callable[[], None]) -> None:
        self._most, self._timeout_s, self._flight, self._check = workers, timeout_s, flight, check
        self._workers: list[_Worker] = []
        self._deaths: Counter[int] = Counter()
        self._environment: dict[str, str | None] = {}

    def __enter__(self) -> Self:
        self._environment = {name: os.environ.get(name) for name in _ONE_THREAD}
        for name in _ONE_THREAD:
            os.environ.setdefault(name, "1")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for worker in self._workers:
            worker.end(at_once=kind is not None)
        for name, value in self._environment.items():
            if value is None:
                os.environ.pop(name, None)

    def done(self, jobs: Sequence[Job]) -> Iterator[Done | None]:
        """Fly the jobs; yield each as it is done, and None now and then while nothing is.

        Raises:
            DockairError: the flight function cannot be imported; what `check` raises.
        """
        waiting = deque(jobs)
        while waiting or any(worker.job for worker in self._workers):
            self._hand_out(waiting)
            busy = [worker for worker in self._workers if worker.job is not None]
            wait([worker.connection for worker in busy], _TICK_S)
            finished = [done for worker in busy if (done := self._outcome(worker, waiting)) is not None]
            yield from finished or (None,)

    def _hand_out(self, waiting: deque[Job]) -> None:
        idle = [worker for worker in self._workers if worker.job is None]
        while waiting and (idle or len(self._workers) < self._most):
            if not idle:
                self._check()
                self._workers.append(_Worker(self._flight))
                idle.append(self._workers[-1])
            idle.pop().take(waiting.popleft())

    def _outcome(self, worker: _Worker, waiting: deque[Job]) -> Done | None:
        job = worker.job
        assert job is not None
        try:
            answer = worker.answer()
        except EOFError:
            return self._dead(worker, job, waiting)
        if answer is not None:
            worker.job, worker.flown = None, worker.flown + 1
            if worker.flown >= FLIGHTS_OF_A_PROCESS:
                self._dismiss(worker, at_once=False)
            return Done(job, answer)
        if not worker.is_late(self._timeout_s):
            return None
        self._dismiss(worker, at_once=True)
        error = f"no result within {self._timeout_s:g} s"
        return Done(job, Answer(columns=None, error=error, wall_time_s=self._timeout_s))

    def _dead(self, worker: _Worker, job: Job, waiting: deque[Job]) -> Done | None:
        wall_time_s = time.monotonic() - worker.begun_s
        self._dismiss(worker, at_once=True)
        self._deaths[job.number] += 1
        if self._deaths[job.number] < DEATHS_OF_A_JOB:
            waiting.appendleft(job)
            return None
        error = _how_it_died(worker.process.exitcode)
        return Done(job, Answer(columns=None, error=error, wall_time_s=wall_time_s))

    def _dismiss(self, worker: _Worker, *, at_once: bool) -> None:
        worker.end(at_once=at_once)
        self._workers.remove(worker)


def _how_it_died(status: int | None) -> str:
    if status is None or status >= 0:
        return f"process ended with status {status}, {DEATHS_OF_A_JOB} times"
    names = {known.value: known.name for known in signal.Signals}
    name = names.get(-status, f"signal {-status}")  # of the real-time signals only the ends of their range have names
    why = ", as when memory runs out" if -status == signal.SIGKILL else ""
    return f"process ended by {name}{why}, {DEATHS_OF_A_JOB} times"
