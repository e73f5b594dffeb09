"""Where the time of a flight goes: frames per second of the closed loop, and each part's share.

Speeds are benchmarks, never tests: they belong to the machine that printed them.
"""

import functools
import importlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

from dockair.scenarios.schema import Scenario
from dockair.sim.opengl import kind_of_context

#: Part -> (module, attribute or Class.method). An inner part is named before the outer one that contains it.
PARTS: dict[str, tuple[str, str]] = {
    "physics": ("dockair.sim.world", "World.step"),
    "render": ("dockair.sim.camera.background", "Background.electrons"),
    "sensor": ("dockair.sim.camera.camera", "NearInfraredCamera.expose"),
    "detect": ("dockair.nav.ring_finder", "detect"),
    "identify": ("dockair.nav.ring_finder", "identify"),
    "pose": ("dockair.nav.belief_update", "solve_pose"),
    "navigation": ("dockair.nav.navigator", "Navigator.step"),
}
#: What a part contains of the others; its share is its own time without theirs.
CONTAINS = {"sensor": ("render",), "navigation": ("detect", "identify", "pose")}


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchReport:
    """Figures of one benchmark flight."""

    simulated_s: float
    wall_s: float
    frames: int
    seconds_by_part: dict[str, float]
    calls_by_part: dict[str, int]

    @property
    def frames_per_second(self) -> float:
        """Camera frames through the whole loop per second of wall time."""
        return self.frames / self.wall_s

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second of wall time."""
        return self.simulated_s / self.wall_s

    def to_json(self) -> dict[str, Any]:
        """Return what `dockair bench --json` prints."""
        own = self.seconds_by_part
        other = self.wall_s - sum(own.values())
        return {
            "frames_per_second": self.frames_per_second,
            "real_time_factor": self.real_time_factor,
            "frames": self.frames,
            "wall_s": self.wall_s,
            "simulated_s": self.simulated_s,
            "share": {part: s / self.wall_s for part, s in own.items()} | {"other": other / self.wall_s},
            "milliseconds_per_call": {part: 1e3 * s / max(self.calls_by_part[part], 1) for part, s in own.items()},
        }


@contextmanager
def _stopwatches() -> Iterator[tuple[dict[str, float], dict[str, int]]]:
    seconds, calls = dict.fromkeys(PARTS, 0.0), dict.fromkeys(PARTS, 0)

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                seconds[part] += time.perf_counter() - start
                calls[part] += 1

        return wrapper

    with ExitStack() as stack:
        for part, (module, name) in PARTS.items():
            target = f"{module}.{name}"
            owner: Any = __import__(module, fromlist=["_"])
            for piece in name.split("."):
                owner = getattr(owner, piece)
            stack.enter_context(patch(target, timed(part, owner)))
        yield seconds, calls


def bench(scenario: Scenario, seconds: float = 20.0) -> BenchReport:
    """Fly a scenario without recording and say where the time went.

    Args:
        scenario: what to fly, with its own seed.
        seconds: how much simulated time at most; a first second, with its compilation, is not counted.
    """
    from dockair.scenarios.loop import Flight

    frames = 0
    flight = Flight(scenario, scenario.seed)
    try:
        for _ in range(scenario.rates.control_hz):
            flight.step()
        with _stopwatches() as (spent, calls):
            start, begin_s = time.perf_counter(), flight.truth.time_s
            for _ in range(round(seconds * scenario.rates.control_hz)):
                tick = flight.step()
                frames += tick.frame is not None
                if tick.outcome is not None:
                    break
            wall_s, simulated_s = time.perf_counter() - start, flight.truth.time_s - begin_s
    finally:
        flight.close()
    own = {part: s - sum(spent[inner] for inner in CONTAINS.get(part, ())) for part, s in spent.items()}
    return BenchReport(simulated_s=simulated_s, wall_s=wall_s, frames=frames, seconds_by_part=own, calls_by_part=calls)


def bench_stages(subject: str, scenario: Scenario) -> dict[str, Any]:
    """Return the speeds of one part's stages, {"milliseconds" or "microseconds": {what: time}, "ratios": {...}}.

    Args:
        subject: "sensors", "image", "pose", "world" or "loop".
        scenario: whose sensors are measured; the other parts have their own.
    """
    os.environ.setdefault("MUJOCO_GL", kind_of_context())  # mujoco.Renderer asks for it at its first import
    if subject == "sensors":
        from dockair.scenarios.bench.sensors import bench_sensors

        return bench_sensors(scenario)
    module = importlib.import_module(f"dockair.scenarios.bench.{subject}")
    figures: dict[str, Any] = getattr(module, f"bench_{subject}")()
    return figures
