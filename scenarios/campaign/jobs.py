"""The flights of a plan, numbered: scenario by scenario, point by point, seed by seed.

A job's key is made of what decides the flight (scenario with every setting, seed) and of nothing else, so that a flight
that is done is known again when the plan has grown.
"""

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.draws import Point, grid, samples
from dockair.scenarios.campaign.plan import Entry, Plan
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.schema import Scenario, load_scenario

MOST_JOBS = 200_000
_SAYS_NOTHING_OF_THE_FLIGHT = {"seed", "claim", "accept"}  # of a scenario's keys; the seed is the job's


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

    @property
    def as_written(self) -> bool:
        """Whether the plan changes nothing of the scenario, whose claims then hold or do not."""
        return not self.settings

    @property
    def command(self) -> str:
        """What flies this flight again."""
        changes = [f"--set {shlex.quote(f'{key}={as_toml(value)}')}" for key, value in self.settings.items()]
        return " ".join(["dockair fly", shlex.quote(self.file), f"--seed {self.seed}", *changes])

    @property
    def key(self) -> str:
        """What decides the flight."""
        return f"{self.scenario_hash}:{self.seed}"


def jobs_of(source: PlanFile) -> list[Job]:
    """Return the plan's jobs in the order of the table.

    Raises:
        DockairError: a scenario that cannot be flown as the plan says; a navigator that cannot be imported; two jobs
            that are the same flight; too many.
    """
    jobs: list[Job] = []
    for index, entry in enumerate(source.plan.scenarios):
        seeds = [source.plan.first_seed + seed for seed in entry.seeds or source.plan.seeds]
        for point, seeds_there in _points(source.plan, seeds):
            settings = source.plan.set | entry.set | point | source.settings
            file, scenario = _scenario(source, index, entry, point)
            digest = scenario_hash(scenario)
            jobs += [
                Job(len(jobs) + k, scenario, digest, seed, point, file, settings) for k, seed in enumerate(seeds_there)
            ]
            if len(jobs) > MOST_JOBS:
                raise DockairError(source.place("seeds"), expected=f"up to {MOST_JOBS} flights", got=len(jobs))
    _refuse_twins(source, jobs)
    names = sorted({job.scenario.name for job in jobs})
    for name in source.plan.gate.scenarios:
        if name not in names:
            raise DockairError(
                source.place("gate.scenarios"), expected="a scenario of the plan", got=name, exists=names
            )
    for name in sorted({job.scenario.navigation.navigator for job in jobs} - {"truth"}):
        _require_navigator(source, name)
    return jobs


def with_background(job: Job, background: str) -> Job:
    """Return the job with a drawn background instead of "auto": found out once, it is the same in every process."""
    camera = job.scenario.camera
    if camera.background != "auto" or not background:
        return job
    drawn = camera.model_copy(update={"background": background})
    return replace(job, scenario=job.scenario.model_copy(update={"camera": drawn}))


def scenario_hash(scenario: Scenario) -> str:
    """Return a digest of all that decides a flight but its seed, the sheets that the scenario names included."""
    digest = blake2b(digest_size=8)
    table = scenario.model_dump(mode="json", exclude=_SAYS_NOTHING_OF_THE_FLIGHT)
    digest.update(json.dumps(table, sort_keys=True).encode())
    for path in (scenario.hardware.camera, scenario.hardware.ring):
        if path is not None:
            digest.update(Path(path).read_bytes())
    return digest.hexdigest()


def _points(plan: Plan, seeds: Sequence[int]) -> list[tuple[Point, list[int]]]:
    """Return the points, each with the seeds that are flown there."""
    draws = plan.drawn
    if not draws:
        return [({}, list(seeds))]
    if plan.sampler == "grid":
        return [(point, list(seeds)) for point in grid(draws, MOST_JOBS)]
    if plan.draws is not None:
        return [(point, list(seeds)) for point in samples(draws, plan.sampler, plan.draws, plan.draw_seed)]
    points = samples(draws, plan.sampler, len(seeds), plan.draw_seed)
    return [(point, [seed]) for point, seed in zip(points, seeds, strict=True)]


def _scenario(source: PlanFile, index: int, entry: Entry, point: Point) -> tuple[str, Scenario]:
    own_file = entry.scenario.lower().endswith(".toml") or os.sep in entry.scenario
    name = str(source.folder / entry.scenario) if own_file else entry.scenario
    layers: tuple[tuple[str, Mapping[str, Any]], ...] = (
        (source.place("set.{key}"), source.plan.set),
        (source.place(f"scenarios[{index}].set.") + "{key}", entry.set),
        (source.place('draw."{key}"'), point),
        ("--set {key}", source.settings),
    )
    settings = {key: value for _, layer in layers for key, value in layer.items()}
    try:
        return name, load_scenario(name, {key: as_toml(value) for key, value in settings.items()})
    except DockairError as error:
        where = _blamed(error.where, layers, source.place(f"scenarios[{index}]"))
        raise DockairError(where, expected=error.expected, got=error.got, exists=error.exists) from None


def as_toml(value: Any) -> str:
    """Return a value as TOML writes it, so that a text stays a text; `--set` reads it."""
    return json.dumps(value, ensure_ascii=False)


def _blamed(where: str, layers: Sequence[tuple[str, Mapping[str, Any]]], otherwise: str) -> str:
    """Return the place in the plan, or on the command line, of what `load_scenario` says of a `--set`."""
    wrong = where.removeprefix("--set ")
    if wrong == where:
        return f"{otherwise}: {where}"
    for place, layer in layers[::-1]:
        for key in layer:
            if wrong == key or wrong.startswith((f"{key}.", f"{key}[")) or key.startswith(f"{wrong}."):
                return place.replace("{key}", key)
    return f"{otherwise}: {wrong}"


def _refuse_twins(source: PlanFile, jobs: Sequence[Job]) -> None:
    seen: set[str] = set()
    for job in jobs:
        if job.key in seen:
            got = f"{job.scenario.name}, seed {job.seed}, twice"
            raise DockairError(source.place("scenarios"), expected="every flight once", got=got)
        seen.add(job.key)


def _require_navigator(source: PlanFile, name: str) -> None:
    from dockair.scenarios.exact_json import import_by_name

    try:
        import_by_name(name)
    except DockairError as error:
        raise DockairError(source.place("navigation.navigator"), expected=error.expected, got=error.got) from None
