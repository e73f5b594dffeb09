"""The flights of a plan, numbered: scenario by scenario, point by point, seed by seed.

A job's key is made of what decides the flight (scenario with every setting, seed) and of nothing else, so that a flight
that is done is known again when the plan has grown.
"""

import os
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.assembly.buildable import require_buildable
from dockair.scenarios.campaign.draws import Point
from dockair.scenarios.campaign.plan import Entry
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.points import points_of, refuse_too_many, seeds_of
from dockair.scenarios.dotted_key import is_within, parts_of
from dockair.scenarios.path_keys import from_folder
from dockair.scenarios.scenario_hash import file_hash, require_decisive, scenario_hash
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.scenarios.toml_files import toml_text

_STRENGTHS = ("turbulence.sigma_m_s", "turbulence.intensity")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

#: Where the keys were written ("{key}" stands for each), and what they are set to; the later hold.
Layers = Sequence[tuple[str, Mapping[str, Any]]]


@dataclass(frozen=True, slots=True)
class Job:
    """One flight of a campaign."""

    number: int
    scenario: Scenario
    scenario_hash: str
    seed: int
    drawn: Point
    file: str  #: name in the library, or path, of the scenario
    settings: Mapping[str, Any]  #: dotted key -> value that the plan sets over the file
    file_hash: str  #: what the file says of the flight; see `file_hash`

    @property
    def as_written(self) -> bool:
        """Whether the plan changes nothing of the scenario, whose claims then hold or do not."""
        return not self.settings

    @property
    def is_of_own_file(self) -> bool:
        """Whether the scenario is a file of one's own, and none of the library."""
        return _is_path(self.file)

    @property
    def command(self) -> str:
        """What flies this flight again."""
        changes = [f"--set {shlex.quote(f'{key}={as_toml(value, key)}')}" for key, value in self.settings.items()]
        file = f".{os.sep}{self.file}" if self.file.startswith("-") else self.file  # it would be read as an option
        return " ".join(["dockair fly", shlex.quote(file), f"--seed {self.seed}", *changes])

    @property
    def key(self) -> str:
        """What decides the flight."""
        return f"{self.scenario_hash}:{self.seed}"

    @property
    def plug_in(self) -> str:
        """Module of the navigator where that is one's own, "" where Dockair navigates, or the truth."""
        navigation = self.scenario.navigation
        module = navigation.name.partition(":")[0]
        return "" if navigation.is_truth or module.partition(".")[0] == "dockair" else module


def jobs_of(source: PlanFile) -> list[Job]:
    """Return the plan's jobs in the order of the table.

    Raises:
        DockairError: a scenario that cannot be flown as the plan says; a path or a setting that no table can hold;
            a key that decides nothing, or is not flown as drawn; two scenarios of one name; a navigator that cannot be
            imported; two jobs that are the same flight; too many; a seed that is too large.
    """
    refuse_too_many(source)
    for key, value in source.settings.items():
        _require_text(f"--set {key}", as_toml(value, f"--set {key}"))
    jobs: list[Job] = []
    for index, entry in enumerate(source.plan.scenarios):
        content, points = "", points_of(source, seeds_of(source, entry))
        for point, seeds in points:
            layers = _layers(source, index, entry, point)
            _require_decisive(layers)
            settings = _merged(layers)
            file, scenario = _scenario(source, index, entry, layers, settings)
            _require_text(source.place(f"scenarios[{index}]"), file)
            _require_as_drawn(source, scenario, point)
            digest, content = scenario_hash(scenario), content or file_hash(file)
            jobs += [
                Job(len(jobs) + k, scenario, digest, seed, point, file, settings, content)
                for k, seed in enumerate(seeds)
            ]
        _require_listed(source, index, entry, [point for point, _ in points])
    for job in {(job.scenario_hash, job.scenario.navigation.navigator): job for job in jobs}.values():
        _require_buildable(source, job)
    _refuse_twins(source, jobs)
    _refuse_namesakes(source, jobs)
    names = sorted({job.scenario.name for job in jobs})
    for name in source.plan.gate.scenarios:
        if name not in names:
            raise DockairError(
                source.place("gate.scenarios"), expected="a scenario of the plan", got=name, exists=names
            )
    return jobs


def _require_text(where: str, written: str) -> None:
    """Refuse what is not UTF-8, as a path and the command line may be: the table's column `command` cannot hold it."""
    try:
        written.encode()
    except UnicodeEncodeError:
        raise DockairError(where, expected="UTF-8", got=written) from None


def _require_buildable(source: PlanFile, job: Job) -> None:
    """Refuse a scenario of which no flight could be built: each would be a row with the same error."""
    try:
        require_buildable(job.scenario)
    except DockairError as error:
        raise error.at(f"{source.place('scenarios')}: {job.scenario.name}: {error.where}") from None


def with_background(job: Job, background: str) -> Job:
    """Return the job with a drawn background instead of "auto": found out once, it is the same in every process."""
    camera = job.scenario.camera
    if camera.background != "auto" or not background:
        return job
    drawn = camera.model_copy(update={"background": background})
    return replace(job, scenario=job.scenario.model_copy(update={"camera": drawn}))


def _layers(source: PlanFile, index: int, entry: Entry, point: Point) -> Layers:
    return (
        (source.place("set.{key}"), _from_folder(source.plan.set, source.folder)),
        (source.place(f"scenarios[{index}].set.") + "{key}", _from_folder(entry.set, source.folder)),
        (source.place('draw."{key}"'), _from_folder(point, source.folder)),
        ("--set {key}", source.settings),
    )


def _from_folder(settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return settings with their paths taken from the plan's folder, as those of scenarios are from theirs."""
    return {key: from_folder(folder, key, value) for key, value in settings.items()}


def _merged(layers: Layers) -> dict[str, Any]:
    """Return what is set, the later last: of two keys that exclude each other the last one is flown.

    What is set again, by itself or with the list or table that it stands in, is what it was set to last.
    """
    settings: dict[str, Any] = {}
    for _, layer in layers:
        for key, value in layer.items():
            settings = {earlier: was for earlier, was in settings.items() if not is_within(earlier, key)}
            settings[key] = value
    return settings


def _scenario(
    source: PlanFile, index: int, entry: Entry, layers: Layers, settings: Mapping[str, Any]
) -> tuple[str, Scenario]:
    name = str(source.folder / entry.scenario) if _is_path(entry.scenario) else entry.scenario
    try:
        return name, load_scenario(name, {key: as_toml(value, f"--set {key}") for key, value in settings.items()})
    except DockairError as error:
        where = _blamed(error.where, layers, source.place(f"scenarios[{index}]"))
        raise error.at(where) from None


def _is_path(scenario: str) -> bool:
    """Whether a scenario is named by its path: by its name it is the library's."""
    return scenario.lower().endswith(".toml") or os.sep in scenario


def _require_listed(source: PlanFile, index: int, entry: Entry, points: Sequence[Point]) -> None:
    """Refuse a listed value that no flight can have, though this time none has drawn it: more seeds would."""
    listed = {key: draw.values for key, draw in source.plan.drawn.items() if draw.values}
    for key, values in listed.items():
        drawn = {as_toml(point[key], key) for point in points}
        for value in values:
            if as_toml(value, key) not in drawn:
                layers = _layers(source, index, entry, points[0] | {key: value})
                _scenario(source, index, entry, layers, _merged(layers))


def _require_decisive(layers: Layers) -> None:
    """Refuse a key that decides nothing: a plan has seeds of its own, and claims hold of scenarios as they are."""
    for place, layer in layers:
        for key in layer:
            require_decisive(key, place.replace("{key}", key), key)


def _require_as_drawn(source: PlanFile, scenario: Scenario, point: Point) -> None:
    """Refuse a drawn key that another setting replaces: its column would be of no flight."""
    for key, drawn in _from_folder(point, source.folder).items():
        flown = _value_at(scenario, key)
        if flown != drawn:
            where, expected = source.place(f'draw."{key}"'), "a key in whose place nothing else is set or drawn"
            raise DockairError(where, expected=expected, got=f"{flown} flown, {drawn} drawn")
        if key in _STRENGTHS and scenario.turbulence.model == "none":
            expected = "turbulence.model that is not set to none, or no strength to draw"
            raise DockairError(source.place(f'draw."{key}"'), expected=expected, got="still air flown")


def _value_at(scenario: Scenario, key: str) -> Any:
    value: Any = scenario
    for part in parts_of(key):
        if isinstance(part, int):
            value = value[part] if isinstance(value, tuple | list) and part < len(value) else None
        else:
            value = value.get(part) if isinstance(value, Mapping) else getattr(value, part, None)
    return value


def as_toml(value: Any, where: str) -> str:
    """Return a value as TOML writes it in one line, so that a text stays a text; `--set` reads it.

    Args:
        value: that the plan or the command line sets.
        where: its place, to be named.

    Raises:
        DockairError: a date or a time, which no key takes.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(as_toml(entry, where) for entry in value)}]"
    if isinstance(value, dict):
        pairs = (f"{_toml_key(key)} = {as_toml(entry, where)}" for key, entry in value.items())
        return f"{{{', '.join(pairs)}}}"
    raise DockairError(where, expected="a number, a text, true or false, a list or a table", got=str(value))


def _toml_key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else as_toml(key, key)


def _blamed(where: str, layers: Layers, otherwise: str) -> str:
    """Return the place in the plan, or on the command line, of what `load_scenario` says of a `--set`."""
    wrong = where.removeprefix("--set ")
    if wrong == where:
        return f"{otherwise}: {where}"
    for place, layer in layers[::-1]:
        for key in layer:
            if is_within(wrong, key) or is_within(key, wrong):
                return place.replace("{key}", key)
    return f"{otherwise}: {wrong}"


def _refuse_twins(source: PlanFile, jobs: Sequence[Job]) -> None:
    seen: set[str] = set()
    for job in jobs:
        if job.key in seen:
            got = f"{job.scenario.name}, seed {job.seed}, twice"
            raise DockairError(source.place("scenarios"), expected="every flight once", got=got)
        seen.add(job.key)


def _refuse_namesakes(source: PlanFile, jobs: Sequence[Job]) -> None:
    """Refuse two scenarios of one name: gate, summary and report pool flights by it."""
    first: dict[str, Job] = {}
    for job in jobs:
        earlier = first.setdefault(job.scenario.name, job)
        if job.file_hash != earlier.file_hash:
            expected = "a name for each scenario, for flights are pooled by it"
            got = f"{job.scenario.name} in {earlier.file}, another in {job.file}"
            raise DockairError(source.place("scenarios"), expected=expected, got=got)
