"""The seeds and the drawn points of a plan, and how many flights they make; counted before they are made."""

import json
import math
from collections import Counter
from collections.abc import Sequence

from dockair.errors import DockairError
from dockair.scenarios.campaign.draws import Point, grid, samples
from dockair.scenarios.campaign.plan import Entry
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.streams import LARGEST_SEED

MOST_JOBS = 200_000


def seeds_of(source: PlanFile, entry: Entry) -> list[int]:
    """Return an entry's seeds.

    Raises:
        DockairError: one that no scenario and no table takes.
    """
    seeds = [source.plan.first_seed + seed for seed in entry.seeds or source.plan.seeds]
    if max(seeds) > LARGEST_SEED:
        expected = f"seeds up to {LARGEST_SEED}, first_seed added"
        raise DockairError(source.place("first_seed"), expected=expected, got=max(seeds))
    return seeds


def runs_of(seeds: Sequence[int]) -> list[tuple[int, int]]:
    """Return (first, last) of each run of whole numbers that follow one another."""
    runs: list[tuple[int, int]] = []
    for seed in seeds:
        if runs and seed == runs[-1][1] + 1:
            runs[-1] = runs[-1][0], seed
        else:
            runs.append((seed, seed))
    return runs


def refuse_too_many(source: PlanFile) -> None:
    """Count the flights before any of them is made: they may be more than the memory holds.

    Raises:
        DockairError: there are too many.
    """
    plan = source.plan
    seeds = sum(len(entry.seeds or plan.seeds) for entry in plan.scenarios)
    points, key = plan.draws or 1, "seeds" if plan.draws is None else "draws"
    if plan.sampler == "grid" and plan.draw:
        key = "draw"
        points = math.prod(len(draw.values or ()) or draw.points or 1 for draw in plan.drawn.values())
    if points * seeds > MOST_JOBS:
        raise DockairError(source.place(key), expected=f"up to {MOST_JOBS} flights", got=points * seeds)


def points_of(source: PlanFile, seeds: Sequence[int]) -> list[tuple[Point, Sequence[int]]]:
    """Return the points, each with the seeds that are flown there.

    Raises:
        DockairError: two that are the same, or a grid of which there is no saying which.
    """
    plan = source.plan
    draws = plan.drawn
    if not draws:
        return [({}, seeds)]
    if plan.sampler != "grid" and plan.draws is None:
        points = samples(draws, plan.sampler, len(seeds), plan.draw_seed)
        return [(point, [seed]) for point, seed in zip(points, seeds, strict=True)]
    if plan.sampler == "grid":
        points = grid(draws, MOST_JOBS, source.place)
        _refuse_twin_points(points, source.place("draw"), "values that differ")
    else:
        points = samples(draws, plan.sampler, plan.draws or 1, plan.draw_seed)
        expected = 'points that differ; of listed values fewer draws make them, or sampler = "grid" without draws'
        _refuse_twin_points(points, source.place("draws"), expected)
    return [(point, seeds) for point in points]


def _refuse_twin_points(points: Sequence[Point], where: str, expected: str) -> None:
    """Refuse points that would be flown with every seed more than once."""
    point, times = Counter(tuple(point.items()) for point in points).most_common(1)[0]
    if times > 1:
        got = f"{', '.join(f'{key} = {json.dumps(value)}' for key, value in point)} {times} times"
        raise DockairError(where, expected=expected, got=got)
