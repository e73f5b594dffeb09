"""What a campaign would fly, group by group, without flying or writing anything."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dockair.scenarios.campaign import journal
from dockair.scenarios.campaign.code import code_of
from dockair.scenarios.campaign.folder import check, entries_of
from dockair.scenarios.campaign.manifest import manifest_of, read_manifest, require_same
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.row import flight_of, unflown
from dockair.scenarios.campaign.run import checked_jobs
from dockair.scenarios.campaign.worker import FLIGHT
from dockair.scenarios.report.groups import groups_of


@dataclass(frozen=True, slots=True, kw_only=True)
class DryRun:
    """A campaign that has not been flown, or not to its end."""

    name: str
    folder: Path
    groups: list[dict[str, Any]]  #: scenario, sensing, navigator, controller, settings, flights, of them done
    commands: list[str]  #: that fly the flights one by one, in the order of the plan

    def to_dict(self) -> dict[str, Any]:
        """Return what `dockair campaign --dry-run --json` prints."""
        flights, done = (sum(group[name] for group in self.groups) for name in ("flights", "done"))
        head = {"campaign": self.name, "folder": str(self.folder), "flights": flights, "done": done}
        return head | {"groups": self.groups, "commands": self.commands}


def dry_run(source: PlanFile, folder: Path, *, fresh: bool = False, retry_errors: bool = False) -> DryRun:
    """Return what a campaign would fly; flights in the folder's journal count as done, errors among them.

    Args:
        source: the plan.
        folder: of the campaign.
        fresh: what was flown there does not count.
        retry_errors: what ended in an error does not.

    Raises:
        DockairError: the plan cannot be flown; the folder is no campaign's, or that of another one; its journal is
            damaged.
    """
    jobs = checked_jobs(source)
    check(folder, fresh=fresh)
    entries = entries_of(folder) if not fresh and os.path.isfile(folder / journal.FILE_NAME) else {}
    if entries:
        now = manifest_of(source.plan, jobs, FLIGHT, code_of(jobs))
        require_same(read_manifest(folder), now, set(entries), jobs, f"--out {folder}")
    rows = [entry["row"] for entry in entries.values()]
    done = {flight_of(row) for row in rows if not (retry_errors and row["error"])}
    groups = [
        {**group.kind, "flights": len(group.rows), "done": sum(flight_of(row) in done for row in group.rows)}
        for group in groups_of([unflown(job) for job in jobs])
    ]
    return DryRun(name=source.plan.name, folder=folder, groups=groups, commands=[job.command for job in jobs])
