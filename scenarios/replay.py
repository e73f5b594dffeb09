"""Feeds a recorded flight's messages to a new navigator, where no simulator can be imported, and compares every bit.

What agrees is all of `NavSolution` at every control tick, NaN being equal to NaN. It runs in a process of its own, in
which importing the simulator, MuJoCo, the assets or the parameter sheets raises: so nothing but the recorded frames and
gyro samples can have gone into the estimates.

    python -m dockair.scenarios.replay OUT
"""

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.scenarios.message_log import ESTIMATES, MESSAGES, estimate_row, read_estimates, read_messages
from dockair.scenarios.navigator_recipe import NAVIGATOR, NavigatorRecipe, code_fingerprint, recorded_code
from dockair.scenarios.plug_in import announce_to, signal_to, step_navigator

FORBIDDEN = ("dockair.sim", "mujoco", "dockair.assets", "dockair.parameters")


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The first estimate that did not come out the same."""

    tick: int
    field: str
    recorded: str
    replayed: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayReport:
    """How a replay went."""

    identical: bool
    ticks: int
    frames: int
    first_difference: Difference | None
    same_code: bool = True  #: the navigator's sources and its libraries are those of the flight
    forbidden_modules: tuple[str, ...] = FORBIDDEN

    def to_json(self) -> str:
        """Return one JSON object."""
        return json.dumps(asdict(self))

    def __str__(self) -> str:
        if self.first_difference is None:
            return f"identical: {self.ticks} control ticks, {self.frames} frames, every bit of every estimate"
        d = self.first_difference
        why = "" if self.same_code else "; the navigation's code or its libraries have changed since the flight"
        return f"differs at control tick {d.tick}, {d.field}: recorded {d.recorded}, replayed {d.replayed}{why}"


class _RefuseForbiddenModules(MetaPathFinder):
    """Raises where a forbidden module is looked for."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if any(fullname == name or fullname.startswith(f"{name}.") for name in FORBIDDEN):
            raise ImportError(f"{fullname} must not be imported in a replay")
        return None


def same_bits(a: Array | str, b: Array | str) -> bool:
    """Tell whether two logged values agree in every bit; any NaN equals any NaN, 0.0 and -0.0 differ."""
    if isinstance(a, str) or isinstance(b, str):
        return isinstance(a, str) and isinstance(b, str) and a == b
    if a.shape != b.shape:
        return False
    equal = a.view(np.uint64) == b.view(np.uint64)
    return bool(np.all(equal | (np.isnan(a) & np.isnan(b))))


def replay_in_this_process(out_dir: str | Path) -> ReplayReport:
    """Run the navigator again on the recorded messages; the caller sees to it that no simulator is near.

    Raises:
        DockairError: nothing recorded there, or the navigator cannot be made without the simulator.
    """
    folder = Path(out_dir)
    recipe = NavigatorRecipe.read(folder)
    navigator = recipe.build()
    same_code = recorded_code(folder) == code_fingerprint(recipe.class_name)
    ticks = frames = 0
    for messages, recorded in itertools.zip_longest(read_messages(folder), read_estimates(folder)):
        if messages is None or recorded is None:
            raise DockairError(str(folder), expected="as many messages as estimates", got="a cut-off recording")
        if messages.announcement is not None:
            announce_to(navigator, messages.announcement)
        if messages.signal is not None:
            signal_to(navigator, messages.signal)
        replayed = estimate_row(step_navigator(navigator, messages.imu, messages.frame))
        for name in replayed:
            if name not in recorded or not same_bits(recorded[name], replayed[name]):
                values = {"recorded": str(recorded.get(name, "nothing")), "replayed": str(replayed[name])}
                first = Difference(tick=ticks, field=name, **values)
                return ReplayReport(
                    identical=False, ticks=ticks, frames=frames, first_difference=first, same_code=same_code
                )
        ticks += 1
        frames += messages.frame is not None
    return ReplayReport(identical=True, ticks=ticks, frames=frames, first_difference=None, same_code=same_code)


def replay(out_dir: str | Path) -> ReplayReport:
    """Replay a flight in a fresh process without a simulator.

    Args:
        out_dir: the flight's folder.

    Raises:
        DockairError: nothing recorded there, or the navigator needs what a replay forbids.
    """
    _require_recorded(Path(out_dir))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "dockair.scenarios.replay", str(Path(out_dir).resolve())]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
        raise DockairError(str(out_dir), expected="a flight that can be replayed", got=reason)
    table = json.loads(done.stdout)
    first = table["first_difference"]
    return ReplayReport(
        identical=table["identical"],
        ticks=table["ticks"],
        frames=table["frames"],
        first_difference=Difference(**first) if first else None,
        same_code=table["same_code"],
    )


def _require_recorded(folder: Path) -> None:
    """Refuse a folder without what a replay reads, before a process is made for it."""
    missing = [name for name in (NAVIGATOR, MESSAGES, ESTIMATES) if not (folder / name).is_file()]
    if missing:
        expected = "a flight by camera, recorded with --record window or full"
        what = "a flight that kept no frames" if (folder / "result.json").is_file() else "no flight"
        raise DockairError(str(folder), expected=expected, got=f"{what}: {missing[0]} is not there")


def main(arguments: Sequence[str]) -> int:
    """Replay one folder with the guard in place; one JSON object on stdout, errors in one line on stderr."""
    present = [name for name in FORBIDDEN if name in sys.modules]
    if present:
        sys.stderr.write(f"{present[0]} is already imported; a replay needs a fresh process\n")
        return 2
    sys.meta_path.insert(0, _RefuseForbiddenModules())
    if len(arguments) != 1:
        sys.stderr.write("usage: python -m dockair.scenarios.replay OUT\n")
        return 2
    try:
        with redirect_stdout(sys.stderr):  # whatever a navigator of one's own prints
            report = replay_in_this_process(arguments[0])
    except DockairError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    sys.stdout.write(report.to_json() + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
