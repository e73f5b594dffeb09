"""How fast the world is on this machine, beside MuJoCo alone: one step of the same model, at the same state.

Everything is on: Dryden gusts, wake, bow wave, the receiver's flight control. Parts are timed where the world calls
them, the whole with nothing timed inside, all by turns in one process; every figure is the least of many rounds. Hose
loads and air are the air's motion at all bodies, the loads on hose and drogue and the guide in the pod. Times are the
processor's, so that other processes do not count. Speeds are benchmarks, never tests: they belong to the machine that
printed them.
"""

import copy
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np

from dockair.messages import ReceiverCommand
from dockair.scenarios.assembly.parts import build
from dockair.scenarios.schema import load_scenario
from dockair.sim.world import World

_EVERYTHING = {
    "turbulence.sigma_m_s": 0.5,
    "wake.present": True,
    "bow_wave.present": True,
    "navigation.navigator": "truth",
}
_SETTLE_TICKS = 200
_ROUNDS = 300
_TICKS = 10  # of a round: long beside the clock's own time, short beside another process's turn
_WARM_TICKS = 10  # before a round is timed: a world just restored is a fresh copy, in nobody's cache
#: Part -> what the world calls.
_PARTS = {
    "air's motion": ("dockair.sim.air.motion", "AirMotion", ("at", "step")),
    "hose loads": ("dockair.sim.hose.tow", "Tow", ("wrenches",)),
    "receiver": ("dockair.sim.aircraft.receiver", "Receiver", ("step",)),
    "truth": ("dockair.sim.world", "World", ("_observe",)),
}


def bench_world() -> dict[str, Any]:
    """Return {"microseconds": {what: us}, "ratios": {what: ratio}}."""
    world = build(load_scenario("default", _EVERYTHING), 0).world
    command = ReceiverCommand()
    for _ in range(_SETTLE_TICKS):  # the first ones compile
        world.step(command)
    bare, start = _bare_step(world), world.save()

    def restore() -> None:
        world.restore(start)

    us: dict[str, list[float]] = {"a bare mj_step of the same model": [], "the whole world": []}
    for _ in range(_ROUNDS):
        us["a bare mj_step of the same model"].append(_microseconds(*bare))
        us["the whole world"].append(_microseconds(restore, lambda: world.step(command)))
        for part, spent in _spent_in_parts(world, command).items():
            us.setdefault(part, []).append(spent)
    least = {what: min(times) for what, times in us.items()}
    mj_step = least["a bare mj_step of the same model"]
    ratios = {
        "the whole world over mj_step": least["the whole world"] / mj_step,
        "hose loads and air over mj_step": (least["hose loads"] + least["air's motion"]) / mj_step,
        "simulated over real time, one core": 1e6 * world.model.opt.timestep / least["the whole world"],
    }
    return {"microseconds": least, "ratios": ratios}


def _bare_step(world: World) -> tuple[Callable[[], None], Callable[[], None]]:
    """What goes to where the world is, under the forces of now, and a step of MuJoCo alone, contacts looked for."""
    model = copy.copy(world.model)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    here = np.empty(mujoco.mj_stateSize(model, state))
    mujoco.mj_getState(world.model, world.data, here, state)
    return lambda: mujoco.mj_setState(model, data, here, state), lambda: mujoco.mj_step(model, data)


def _microseconds(restore: Callable[[], None], call: Callable[[], object]) -> float:
    """Mean time of a call in a round [us], which begins where `restore` goes to."""
    restore()
    for _ in range(_WARM_TICKS):
        call()
    begun = time.thread_time()
    for _ in range(_TICKS):
        call()
    return 1e6 * (time.thread_time() - begun) / _TICKS


def _spent_in_parts(world: World, command: ReceiverCommand) -> dict[str, float]:
    """Time of a tick in each part [us]; that of the air's motion is part of the truth's, which asks for it."""
    with _stopwatches() as seconds:
        for _ in range(_TICKS):
            world.step(command)
    return {part: 1e6 * s / _TICKS for part, s in seconds.items()}


def _empty_stopwatch_s() -> float:
    """What a stopwatch shows of nothing: the clock's own time."""
    shown = []
    for _ in range(_ROUNDS):
        begun = time.thread_time()
        shown.append(time.thread_time() - begun)
    return min(shown)


@contextmanager
def _stopwatches() -> Iterator[dict[str, float]]:
    seconds, empty = dict.fromkeys(_PARTS, 0.0), _empty_stopwatch_s()

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            begun = time.thread_time()
            result = function(*args, **kwargs)
            seconds[part] += time.thread_time() - begun - empty
            return result

        return wrapper

    with ExitStack() as stack:
        for part, (module, name, methods) in _PARTS.items():
            owner = getattr(__import__(module, fromlist=["_"]), name)
            for method in methods:
                stack.enter_context(patch.object(owner, method, timed(part, getattr(owner, method))))
        yield seconds
