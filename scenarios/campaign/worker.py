"""What a worker process does: take an order, fly it, answer; an exception is an answer too."""

import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import parent_process
from typing import TYPE_CHECKING, Any

from dockair.scenarios.class_by_name import import_by_name

if TYPE_CHECKING:  # unpickling a job imports what makes scenarios; only who flies it waits for that
    from dockair.scenarios.campaign.jobs import Job

READY = "ready"  #: the first thing a process says
#: From an order to the columns of its row; by name, because a process that is spawned must import it itself.
FLIGHT = "dockair.scenarios.campaign.worker:fly_order"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A job on its way to a process."""

    seed: int
    key: str
    pickled: bytes

    @property
    def job(self) -> "Job":
        """The job itself."""
        job: Job = pickle.loads(self.pickled)
        return job


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of an order."""

    columns: dict[str, Any] | None  #: None: `error` says why
    error: str = ""
    traceback: str = ""
    wall_time_s: float = 0.0


def fly_order(order: Order) -> dict[str, Any]:
    """Fly a job and return its columns."""
    from dockair.scenarios.campaign.row import columns_of
    from dockair.scenarios.loop import fly

    job = order.job
    return columns_of(fly(job.scenario, job.seed, record="none"))


def work(connection: Connection, flight: str) -> None:
    """Answer orders until None comes or whoever sends them has gone.

    Args:
        connection: orders come in; first READY goes out, or a text that says why this process can fly nothing, then an
            `Answer` to each.
        flight: "module:function" from an order to the columns of its row.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then ends this process
    _end_with_parent()
    os.dup2(2, 1)  # stdout is the parent's alone: it may print one JSON object
    try:
        fly: Callable[[Order], dict[str, Any]] = import_by_name(flight)
    except BaseException as error:
        connection.send(f"{flight}: {one_line(error)}")
        return
    connection.send(READY)
    while (order := connection.recv()) is not None:
        connection.send(_answer(fly, order))


def one_line(error: BaseException) -> str:
    """Return the kind of an error and what it says, in one line; what no page and no terminal shows is escaped."""
    line = " ".join(f"{type(error).__name__}: {error}".split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


def _answer(fly: Callable[[Order], dict[str, Any]], order: Order) -> Answer:
    begun = time.perf_counter()
    columns, said, trace = None, "", ""
    try:
        columns = fly(order)
    except BaseException as error:  # one's own navigator may raise anything, SystemExit too
        said, trace = one_line(error), traceback.format_exc()
    return Answer(columns=columns, error=said, traceback=trace, wall_time_s=time.perf_counter() - begun)


def _end_with_parent() -> None:
    """End this process when its parent dies, even in the middle of a flight: nobody waits for its answer."""
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
