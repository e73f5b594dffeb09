"""Runs a campaign: what is not done yet is flown, what is done is written down at once, the table comes last."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign import folder as campaign_folder
from dockair.scenarios.campaign.code import code_of
from dockair.scenarios.campaign.copies import keep_copies
from dockair.scenarios.campaign.gate import Verdict, judge, require_power
from dockair.scenarios.campaign.jobs import Job, jobs_of, with_background
from dockair.scenarios.campaign.journal import Journal
from dockair.scenarios.campaign.manifest import (
    FILE_NAME,
    OF_THE_BEGINNING,
    manifest_of,
    read_manifest,
    require_same,
    write_json,
)
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.pool import Done, Pool
from dockair.scenarios.campaign.row import as_asked, row_of, unflown
from dockair.scenarios.campaign.summary import summary_of
from dockair.scenarios.campaign.table import write_table
from dockair.scenarios.campaign.worker import FLIGHT
from dockair.scenarios.report.groups import groups_of

#: Called with a row and its wall time as it is done, and with None now and then.
Watcher = Callable[[dict[str, Any] | None, float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """A campaign that is over."""

    name: str
    folder: Path
    rows: list[dict[str, Any]]
    groups: list[dict[str, Any]]  #: see `summary`
    verdict: Verdict | None  #: of the plan's gate

    def to_dict(self) -> dict[str, Any]:
        """Return what `dockair campaign --json` prints."""
        return {
            "campaign": self.name,
            "folder": str(self.folder),
            "flights": len(self.rows),
            "groups": self.groups,
            "gate": None if self.verdict is None else self.verdict.to_dict(),
        }


def run(
    source: PlanFile,
    out: Path,
    *,
    workers: int,
    fresh: bool = False,
    retry_errors: bool = False,
    watch: Callable[[list[Job], dict[str, Any]], Watcher] | None = None,
    flight: str = FLIGHT,
) -> Campaign:
    """Fly a plan to its end, or what an earlier run of it has left.

    Args:
        source: the plan.
        out: its folder.
        workers: processes.
        fresh: forget what was flown there.
        retry_errors: fly again what ended in an error.
        watch: from the jobs and the entries that are done already to what is told of every further one.
        flight: "module:function" that flies an order in a process of its own; see `worker`.

    Raises:
        DockairError: the plan cannot be flown, the folder holds something else, or the code has changed meanwhile; what
            was flown is kept.
        MachineError: there is no room; what was flown is kept.
    """
    jobs = checked_jobs(source)
    code = code_of(jobs)
    check = partial(code.require_unchanged, f"--out {out}")
    now = manifest_of(source.plan, jobs, flight, code)
    campaign_folder.make(out, fresh=fresh)
    with Journal(out, unread=fresh) as journal:  # from here on the folder is ours alone
        campaign_folder.remove_parts(out)
        if fresh:
            campaign_folder.remove_results(out)  # first: they must never be of other flights than the journal's
            journal.clear()
        now = _begun_once(journal, out, now, jobs)
        done = {key for key, entry in journal.entries.items() if not (retry_errors and entry["row"]["error"])}
        left = _seed_by_seed([with_background(job, now["background"]) for job in jobs if job.key not in done])
        if left:
            campaign_folder.remove_results(out)  # they are of fewer flights than the manifest will say
        keep_copies(jobs, out)
        write_json(now, out / FILE_NAME)
        told = watch(jobs, {key: journal.entries[key] for key in done}) if watch is not None else _silent
        begun = time.perf_counter()
        with Pool(min(workers, max(len(left), 1)), source.plan.timeout_s, flight, check) as pool:
            for outcome in pool.done(left):
                if outcome is None:
                    told(None, 0.0)
                else:
                    check()  # what was flown while a file changed is nobody's row
                    entry = _entry(outcome)
                    journal.append(entry)
                    told(entry["row"], outcome.answer.wall_time_s)
        if left:
            campaign_folder.remove_results(out)  # a report made meanwhile is of fewer flights than are done
        timing = {"workers": workers, "flown_last": len(left), "wall_time_last_s": time.perf_counter() - begun}
        return _finish(source, out, jobs, [journal.entries[job.key] for job in jobs], timing)


def checked_jobs(source: PlanFile) -> list[Job]:
    """Return the plan's jobs.

    Raises:
        DockairError: the plan cannot be flown, or its gate would say nothing.
    """
    jobs = jobs_of(source)
    _refuse_unlike_in_a_group(source, jobs)
    if source.plan.asked is not None:
        require_power(source.plan.asked, [unflown(job) for job in jobs], source.place("gate"))
    return jobs


def _refuse_unlike_in_a_group(source: PlanFile, jobs: Sequence[Job]) -> None:
    """Refuse flights that would be counted together and are not alike: settings in another order may be others."""
    one_of_each = {job.scenario_hash: unflown(job) for job in jobs if not job.drawn}
    for group in groups_of(list(one_of_each.values())):
        if len(group.rows) > 1:
            expected = "settings that differ in more than their order, or than perfect navigation takes no notice of"
            got = " and ".join(row["command"] for row in group.rows[:2])
            raise DockairError(source.place("scenarios"), expected=expected, got=got)


def _begun_once(journal: Journal, out: Path, now: dict[str, Any], jobs: Sequence[Job]) -> dict[str, Any]:
    """Return the manifest of a new campaign, or of an earlier one that goes on and may have grown."""
    if not journal.entries:
        return now
    if not (out / FILE_NAME).exists():
        raise DockairError(f"--out {out}", expected=f"{FILE_NAME} beside {journal.path.name}", got="none (or --fresh)")
    earlier = read_manifest(out)
    require_same(earlier, now, set(journal.entries), jobs, f"--out {out}")
    return now | {key: earlier[key] for key in OF_THE_BEGINNING if key in earlier}


def _seed_by_seed(jobs: list[Job]) -> list[Job]:
    """Return the jobs so that scenarios take turns, drawn ones too: what is shown meanwhile is of all of them.

    A scenario of which keys are drawn is another at every point, each with its own first seed.
    """
    seeds: Counter[str] = Counter()
    points: Counter[tuple[int, str, str]] = Counter()
    turns: dict[int, tuple[int, int]] = {}
    for job in jobs:
        seed, set_for_all = seeds[job.scenario_hash], {k: v for k, v in job.settings.items() if k not in job.drawn}
        alike = seed, job.scenario.name, repr(set_for_all)
        turns[job.number] = seed, points[alike]
        seeds[job.scenario_hash] += 1
        points[alike] += 1
    return sorted(jobs, key=lambda job: (turns[job.number], job.number))


def _entry(done: Done) -> dict[str, Any]:
    job, answer = done.job, done.answer
    entry = {"key": job.key, "row": row_of(job, answer), "wall_time_s": answer.wall_time_s}
    return entry | ({"traceback": answer.traceback} if answer.traceback else {})


def _finish(
    source: PlanFile, out: Path, jobs: Sequence[Job], entries: Sequence[dict[str, Any]], timing: dict[str, Any]
) -> Campaign:
    """Write the table and what it shows."""
    rows = [as_asked(entry["row"], job) for entry, job in zip(entries, jobs, strict=True)]
    write_table(rows, out)
    verdict = None if source.plan.asked is None else judge(source.plan.asked, rows)
    campaign = Campaign(name=source.plan.name, folder=out, rows=rows, groups=summary_of(rows, jobs), verdict=verdict)
    write_json(timing | {"wall_times_s": [entry["wall_time_s"] for entry in entries]}, out / campaign_folder.TIMING)
    write_json(campaign.to_dict() | {"folder": "."}, out / campaign_folder.SUMMARY)
    return campaign


def _silent(row: dict[str, Any] | None, wall_time_s: float) -> None:
    pass
