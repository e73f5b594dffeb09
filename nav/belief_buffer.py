"""What is believed at the moments of the last second, so that a message that is late finds its place.

A node is a moment with the belief after it: that of a frame, or one to begin at. Between nodes the belief is run
forward with the IMU's samples; the head is that at the newest sample. A frame put among the nodes is followed by all
that is newer, once more: run forward, and each frame taken again, as the filter says.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dockair.messages import STAMP_RESOLUTION_S
from dockair.nav.belief_motion import Motion, propagated
from dockair.nav.belief_sight import Belief
from dockair.nav.imu_record import ImuRecord
from dockair.nav.pose.estimate import PoseEstimate
from dockair.nav.pose.measurement import LinesOfSight
from dockair.rotations import Array

Frame = PoseEstimate | LinesOfSight


@dataclass(slots=True, eq=False)
class Node:
    """A moment, and the belief after it."""

    time_s: float
    frame: Frame | None
    beliefs: list[Belief]
    doubted: bool = False  #: the belief was widened before the frame was taken


def _time(node: Node) -> float:
    return node.time_s


class BeliefBuffer:
    """Nodes in order of time, and the way between them.

    Args:
        record: samples of the IMU; what is older than all nodes is forgotten there.
        motion: of the drogue between them.
        start: the belief before any message.
        taken_again: of a node whose past has changed, what is believed after it, given what is before.
        span_s: how long a node is kept.
        interval_s: between nodes where no frame comes.
    """

    def __init__(
        self,
        record: ImuRecord,
        motion: Motion,
        start: list[Belief],
        taken_again: Callable[[Node, list[Belief]], list[Belief]],
        *,
        span_s: float,
        interval_s: float,
    ) -> None:
        self._record, self._motion, self._start, self._taken_again = record, motion.flat(), start, taken_again
        self._span_s, self._interval_s = span_s, interval_s
        self._nodes: list[Node] = []
        self._head: Node | None = None  #: at the newest sample, when no frame is newer
        self._head_is_due = False  # and is brought there once it is asked for: a frame that comes first moves it anyway
        self._coasted: tuple[Node, Node] | None = None  #: the second: the first, coasted on for long
        self._asked: tuple[list[Belief], Node] | None = None  #: the moment asked for last, from the beliefs before it

    @property
    def start(self) -> list[Belief]:
        """The belief before any message."""
        return self._start

    @property
    def last(self) -> Node | None:
        """The last node, whose beliefs hold what no motion changes as well as the newest; None before the first."""
        return self._nodes[-1] if self._nodes else None

    @property
    def newest_s(self) -> float:
        """Stamp of the newest message; -inf before the first."""
        return max(self._record.newest_s, self._nodes[-1].time_s if self._nodes else -np.inf)

    def begin(self, time_s: float, beliefs: list[Belief]) -> None:
        """Forget all nodes but one, at a time, with these beliefs."""
        self._nodes = [Node(time_s, None, beliefs)]
        self._forget_head()
        self.renew_head()

    def change_all(self, changed: Callable[[Belief], Belief]) -> None:
        """Put another belief in the place of each, the start's too."""
        self._forget_head()
        self._start = [changed(belief) for belief in self._start]
        for node in self._nodes:
            node.beliefs = [changed(belief) for belief in node.beliefs]

    def after_sample(self, before_s: float) -> None:
        """Take note of a sample that is new in the record, the one before it being of `before_s`."""
        time_s = self._record.newest_s
        self._asked = None  # between the last two samples the rate is another now
        self._require_node(time_s)
        if self._nodes[-1].time_s > before_s:
            self._run_from(bisect_right(self._nodes, before_s, key=_time))  # those after it had to guess the rate
        if time_s - self._nodes[-1].time_s >= self._interval_s:
            self.renew_head()
            head = self._renewed_head()
            assert head is not None  # no frame is newer
            self._nodes.append(head)
        self._forget(time_s)

    def _forget(self, now_s: float) -> None:
        """Drop what is older than the span, but for the last node before it."""
        oldest_s = now_s - self._span_s
        if len(self._nodes) > 1 and self._nodes[1].time_s <= oldest_s:
            del self._nodes[: bisect_right(self._nodes, oldest_s, key=_time) - 1]
            self._record.forget(self._nodes[0].time_s)

    def before_frame(self, time_s: float) -> list[Belief] | None:
        """Return what was believed when a frame was taken; None if it is older than all nodes, or was had already."""
        self._require_node(time_s)
        index = bisect_right(self._nodes, time_s, key=_time)
        last = self._nodes[index - 1]
        if index == 0 or (last.time_s == time_s and last.frame is not None):
            return None
        return self._moved(last, time_s)

    def insert(self, node: Node) -> None:
        """Put a frame in its place, and run again what is newer."""
        index = bisect_right(self._nodes, node.time_s, key=_time)
        self._nodes.insert(index, node)
        self._run_from(index + 1)
        self.renew_head()
        self._forget(self._nodes[-1].time_s)  # where no sample comes, frames pile up

    def renew_head(self) -> None:
        """Bring the belief to the newest sample, unless a frame is newer."""
        self._head_is_due = True

    def _renewed_head(self) -> Node | None:
        if not self._head_is_due:
            return self._head
        newest_s, last, head = self._record.newest_s, self._nodes[-1], self._head
        begin = last if head is None or head.time_s < last.time_s else head
        self._head = None if newest_s < last.time_s else Node(newest_s, None, self._moved(begin, newest_s))
        self._head_is_due = False
        return self._head

    def _forget_head(self) -> None:
        self._head, self._head_is_due, self._coasted = None, False, None

    def beliefs(self, time_s: float) -> list[Belief]:
        """Return the belief at a time; the oldest kept if it is older."""
        if not self._nodes:
            return self._start
        head = self._renewed_head() if self._record.newest_s <= time_s else None
        if head is not None:
            return self._coasting(head, time_s)
        index = bisect_right(self._nodes, time_s, key=_time)
        return self._coasting(self._nodes[index - 1], time_s) if index else self._nodes[0].beliefs

    def foretold(self, time_s: float, horizon_s: float) -> tuple[Array, float]:
        """Return what the newest frame that is `horizon_s` old (to the microsecond) or more has foretold of a time.

        Returns:
            (8, 3) state, and the frame's age [s]; NaN where no frame so old is kept.
        """
        index = bisect_right(self._nodes, time_s - horizon_s + STAMP_RESOLUTION_S, key=_time)
        for node in reversed(self._nodes[:index]):
            if node.frame is not None:
                _, x, _ = self._propagated(node.beliefs[0], node.time_s, time_s, errors=False)
                return x, time_s - node.time_s
        return np.full((8, 3), np.nan), float("nan")

    def _require_node(self, time_s: float) -> None:
        if not self._nodes:
            self._nodes.append(Node(time_s, None, self._start))

    def _run_from(self, index: int) -> None:
        """Run the nodes again from one on; the first is given."""
        self._forget_head()
        for i in range(max(index, 1), len(self._nodes)):
            node = self._nodes[i]
            node.beliefs = self._taken_again(node, self._moved(self._nodes[i - 1], node.time_s))

    def _coasting(self, node: Node, time_s: float) -> list[Belief]:
        """As `_moved`; where no message comes for long, the way is not gone again from its beginning every time."""
        kept = self._coasted
        begin = kept[1] if kept is not None and kept[0] is node and kept[1].time_s <= time_s else node
        beliefs = self._moved(begin, time_s)
        if time_s - begin.time_s > self._span_s:
            self._coasted = node, Node(time_s, None, beliefs)
        return beliefs

    def _moved(self, node: Node, time_s: float) -> list[Belief]:
        """Return a node's beliefs at a later time; that of a frame is asked for several times, and found once."""
        if time_s <= node.time_s:
            return node.beliefs
        asked = self._asked
        if asked is not None and asked[0] is node.beliefs and asked[1].time_s == time_s:
            return asked[1].beliefs
        moved = []
        for belief in node.beliefs:
            R, x, P = self._propagated(belief, node.time_s, time_s)
            moved.append(Belief(R, x, P, belief.log_weight, belief.ring))
        self._asked = node.beliefs, Node(time_s, None, moved)
        return moved

    def _propagated(
        self, belief: Belief, begin_s: float, end_s: float, *, errors: bool = True
    ) -> tuple[Array, Array, Array]:
        samples = self._record.times_s, self._record.rates_B, self._record.forces_B
        return propagated(belief.R_BD, belief.x, belief.P, begin_s, end_s, *samples, self._motion, errors)
