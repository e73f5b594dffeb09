"""What a person hands an environment, checked: the options of `reset`, and an action."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.scenarios.envs.tables import ACTION
from dockair.scenarios.scenario_hash import require_decisive
from dockair.scenarios.schema import Scenario, load_scenario

_EXISTS = ("scenario", "seed", "set")
_REAL = "biuf"  # numpy's kinds: complex numbers, texts and objects are none
_OPTION = "--set "  # what the command line calls it
_LONGEST = 80  # characters of what was got


def scenario_from(options: Mapping[str, Any], source: str | Path | Scenario) -> Scenario:
    """Return the scenario that reset's options ask for.

    Args:
        options: as they were handed in.
        source: name, path or Scenario where they name none.

    Raises:
        DockairError: no dictionary, an unknown key, no such scenario, or one that is refused with these settings.
    """
    _check_dictionary("options", options, "a dictionary")
    unknown = sorted(set(options) - set(_EXISTS))
    if unknown:
        raise DockairError("options", expected="a known key", got=unknown[0], exists=_EXISTS)
    source, settings = options.get("scenario", source), options.get("set", {})
    _check_dictionary("options.set", settings, "a dictionary of dotted key -> value")
    if "seed" in settings:  # a scenario's own is where `dockair fly` begins; an environment draws
        expected = 'the option "seed" in its place, or reset(seed=...)'
        raise DockairError("options.set: seed", expected=expected, got=_said(settings["seed"]))
    for key in settings:
        require_decisive(key, f"options.set: {key}", _said(settings[key]))
    if not isinstance(source, (str, Path, Scenario)):
        raise DockairError("scenario", expected="a name, a path or a Scenario", got=_said(source))
    if not isinstance(source, Scenario):
        with _as_an_option():
            return load_scenario(source, settings)
    if settings:
        raise DockairError("options.set", expected="a scenario's name or path beside it", got="a Scenario")
    return source


@contextmanager
def _as_an_option() -> Iterator[None]:
    """Say where a setting was refused as a caller of `reset` wrote it."""
    try:
        yield
    except DockairError as error:
        if not error.where.startswith(_OPTION):
            raise
        where = "options.set: " + error.where.removeprefix(_OPTION)
        raise error.at(where) from None


def command_from(action: Any, space: spaces.Box) -> ReceiverCommand:
    """Return the command of an action; values beyond the space's limits are clipped to them.

    Args:
        action: (6,) numbers of ACTION.
        space: of actions.

    Raises:
        DockairError: the action is not six finite real numbers.
    """
    try:
        values = np.asarray(action)
    except (TypeError, ValueError):  # lists of unequal lengths
        values = np.empty(0)
    if values.dtype.kind not in _REAL or values.shape != space.shape or not np.isfinite(values).all():
        raise DockairError("action", expected=f"{len(ACTION)} finite numbers", got=_said(action))
    values = np.clip(values.astype(np.float64), space.low, space.high)
    return ReceiverCommand(velocity_m_s=values[:3], acceleration_m_s2=values[3:])


def _check_dictionary(where: str, value: Any, expected: str) -> None:
    if not isinstance(value, Mapping):
        raise DockairError(where, expected=expected, got=_said(value))
    for key in value:
        if not isinstance(key, str):
            raise DockairError(where, expected="keys that are text", got=_said(key))


def _said(value: Any) -> Any:
    """Return what an error says was got: the value where that is short, else what it is."""
    text = repr(value)
    if value is not None and len(text) <= _LONGEST and "\n" not in text:
        return value
    shape = getattr(value, "shape", None)
    return type(value).__name__ if shape is None else f"{type(value).__name__} of shape {shape}"
