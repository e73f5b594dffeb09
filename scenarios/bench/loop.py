"""How fast flights go on this machine, from the loop's own second core to two flights at once.

Each line is a whole flight in a process of its own; its first second, in which kernels are loaded or compiled, is not
counted. All are flown by turns, and of each the fastest stands in its line: what else wants the machine, or the machine
under a virtual one, only makes a flight slower. `median` and `slowest`, of all its turns, say how much it did.

`x_real_time` is simulated over wall time. `x_of_own_time` is simulated over the processor's time of the flight or of
the camera's process, whichever is longer: what it could be at most with nothing else on the machine. What a process
waits for the other awake counts, what it sleeps does not; see `camera_process`. `waited_s` is the wall time for which a
flight has waited for its camera, awake or not. `load` is the mean number of processes that wanted a core in the minute
before the end, this one's among them. Where it is above the number of cores, wall time says how busy the machine was;
the processor's time is longer then, too, because caches and cores are shared.

    two at once over one = sum of the two speeds / speed of one alone, no flight with a second process

is of flights one after the other, too: the median of the turns.

Beside it stands what others run: steps a second (of the processor's time) of `DockFast-v0`, 0.01 s each, beside
gymnasium's `Humanoid-v5`, 0.015 s each, by turns, if gymnasium's MuJoCo extra is installed. Speeds are benchmarks,
never tests: they belong to the machine that printed them.
"""

import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dockair.scenarios.loop import Flight

_180_HZ = {"rates.physics_hz": 1800, "rates.gyro_hz": 450, "rates.control_hz": 180, "rates.camera_hz": 180}
_TRUTH = {"navigation.navigator": "truth"}
_ONE_CORE = {"overlap": False}
#: What -> settings of the default scenario, and how it is flown.
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "windowed, 50 Hz": ({}, {}),
    "windowed, 50 Hz, recorded": ({}, {"record": "window"}),
    "full frames, 50 Hz": ({}, {"full_frames": True}),
    "windowed, 180 Hz": (_180_HZ, {}),
    "windowed, 50 Hz, one process": ({}, _ONE_CORE),
    "measurements in the place of frames": ({"camera.sensing": "measurements"}, _ONE_CORE),
    "perfect navigation": (_TRUTH, _ONE_CORE),
}
_ALONE = "windowed, 50 Hz, one process"
_WARM_UP_S = 1.0
_ENVIRONMENTS = ("dockair/DockFast-v0", "Humanoid-v5")
_STEPS, _TURNS = 50, 20  # of each environment in a turn; turns
_FLIGHTS = 5  # of each case
_SCRIPT = """
import json, sys
from dockair.scenarios.bench.loop import fly_timed
print(json.dumps(fly_timed(sys.argv[1])))
"""
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # a thread pool would be a third process


def bench_loop() -> dict[str, Any]:
    """Return {"flights": {what: {column: value}}, "steps_per_second": {environment: number}, "ratios": {...}}."""
    turns: dict[str, list[dict[str, float]]] = {what: [] for what in CASES}
    together = []
    for _ in range(_FLIGHTS):
        for what, flown in turns.items():
            flown += _at_once(what, 1)
        pair = _at_once(_ALONE, 2)
        together.append(sum(each["x_real_time"] for each in pair) / turns[_ALONE][-1]["x_real_time"])
    steps = environment_speeds()
    ratios = {"two flights at once over one": median(together)}
    if all(name in steps for name in _ENVIRONMENTS):
        ours, theirs = (steps[name] for name in _ENVIRONMENTS)
        ratios["steps a second, DockFast-v0 over Humanoid-v5"] = ours / theirs
    return {
        "flights": {what: _fastest(flown) for what, flown in turns.items()},
        "steps_per_second": steps,
        "ratios": ratios,
    }


def fly_timed(what: str, seconds: float = 1e9) -> dict[str, float]:
    """Fly a case in this process and say how long it took, by the clock and by the processor's time.

    Args:
        what: of `CASES`.
        seconds: of simulated time at most, after the first that is not counted.
    """
    from dockair.scenarios.loop import Flight
    from dockair.scenarios.schema import load_scenario

    settings, how = CASES[what]
    scenario = load_scenario("default", settings)
    full_frames, overlap = how.get("full_frames", False), how.get("overlap", True)
    with _recording(how.get("record", "none")) as folder:
        flight = Flight(scenario, scenario.seed, full_frames=full_frames, overlap=overlap)
        try:
            figures = _timed(flight, folder, seconds)
        finally:
            flight.close()
    own_time = figures["simulated_s"] / max(figures["flight_process_s"], figures["camera_process_s"])
    load = os.getloadavg()[0]
    return {"x_real_time": figures.pop("x_real_time"), "x_of_own_time": own_time} | figures | {"load": load}


def environment_speeds() -> dict[str, float]:
    """Return the steps a second of those of the environments that can be made here, their actions random."""
    import gymnasium

    import dockair  # noqa: F401  # registers its environments

    made = {}
    for name in _ENVIRONMENTS:
        with suppress(ImportError, gymnasium.error.DependencyNotInstalled):
            made[name] = gymnasium.make(name)
    least = dict.fromkeys(made, float("inf"))
    for environment in made.values():
        environment.reset(seed=0)
        environment.action_space.seed(0)
    for _ in range(_TURNS):
        for name, environment in made.items():
            least[name] = min(least[name], _time_of_steps(environment))
    for environment in made.values():
        environment.close()
    return {name: _STEPS / seconds for name, seconds in least.items()}


def _time_of_steps(environment: Any) -> float:
    """The processor's time of some steps [s]; resets are not counted."""
    spent = 0.0
    for _ in range(_STEPS):
        action = environment.action_space.sample()
        begun = time.process_time()
        _, _, terminated, truncated, _ = environment.step(action)
        spent += time.process_time() - begun
        if terminated or truncated:
            environment.reset()
    return spent


@contextmanager
def _recording(record: str) -> Iterator[Path | None]:
    """A folder for the recording, or none."""
    if record == "none":
        yield None
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def _timed(flight: "Flight", folder: Path | None, seconds: float) -> dict[str, float]:
    """Fly to the end; with a folder, record what was delivered."""
    from dockair.scenarios.recorder import Recorder

    frames = 0
    with Recorder(flight, folder, "none" if folder is None else "window") as recorder:
        while flight.truth.time_s < _WARM_UP_S:
            recorder.append(flight.step())
        wall_s, own_s, beside_s = time.perf_counter(), time.process_time(), _children_s()
        waited_s = flight.waited_for_camera_s
        begun_s = flight.truth.time_s
        outcome = None
        while outcome is None and flight.truth.time_s < begun_s + seconds:
            tick = flight.step()
            recorder.append(tick)
            outcome, frames = tick.outcome, frames + (tick.frame is not None)
        simulated_s, waited_s = flight.truth.time_s - begun_s, flight.waited_for_camera_s - waited_s
    # the recorder has written its last message by now
    wall_s, own_s, beside_s = time.perf_counter() - wall_s, time.process_time() - own_s, _children_s() - beside_s
    return {
        "x_real_time": simulated_s / wall_s,
        "simulated_s": simulated_s,
        "wall_s": wall_s,
        "frames_per_s": frames / wall_s,
        "flight_process_s": own_s,
        "camera_process_s": beside_s,
        "waited_s": waited_s,
    }


def _children_s() -> float:
    """The processor's time of the processes beside this one [s]: that of the camera, or none."""
    ticks = 0
    for child in multiprocessing.active_children():
        fields = (
            Path(f"/proc/{child.pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        )
        ticks += int(fields[11]) + int(fields[12])  # user and system, after the name in brackets
    return ticks / os.sysconf("SC_CLK_TCK")


def _fastest(flown: list[dict[str, float]]) -> dict[str, float]:
    """The fastest flight's figures, and how fast the others were."""
    speeds = [flight["x_real_time"] for flight in flown]
    best = flown[speeds.index(max(speeds))]
    return {"x_real_time": max(speeds), "median": median(speeds), "slowest": min(speeds)} | best


def _at_once(what: str, count: int) -> list[dict[str, float]]:
    """Fly a case in so many processes at the same time."""
    command, environment = [sys.executable, "-c", _SCRIPT, what], dict(os.environ) | _ONE_THREAD
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) for _ in range(count)]
    answers = [process.communicate()[0] for process in processes]
    for process in processes:
        if process.returncode != 0:
            raise subprocess.CalledProcessError(process.returncode, command)
    return [json.loads(answer.splitlines()[-1]) for answer in answers]
