"""The command `dockair campaign`."""

import os
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from dockair.scenarios.commands.options import Json, Settings, overrides, print_json, stdout_kept


class Sampler(Enum):
    """How the plan's keys are drawn."""

    GRID = "grid"
    RANDOM = "random"
    LATIN_HYPERCUBE = "latin_hypercube"


def campaign(
    plan: Annotated[
        str | None, typer.Argument(metavar="PLAN", help="A packaged plan or a TOML path; without, the list.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write to; out/campaigns/<plan> by default.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; one a core by default.")] = None,
    sampler: Annotated[Sampler | None, typer.Option(help="How to draw, instead of the plan's way.")] = None,
    seeds: Annotated[int | None, typer.Option(min=1, help="Seeds a scenario, instead of the plan's.")] = None,
    settings: Settings = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what was flown in the folder.")] = False,
    retry_errors: Annotated[bool, typer.Option("--retry-errors", help="Fly again what ended in an error.")] = False,
    dry: Annotated[bool, typer.Option("--dry-run", help="Say what would be flown; fly and write nothing.")] = False,
    as_json: Json = False,
) -> None:
    """Fly a plan's scenarios with many seeds on all cores; killed at any moment, the same command goes on."""
    from dockair.scenarios.campaign.dry_run import dry_run
    from dockair.scenarios.campaign.folder import default_folder
    from dockair.scenarios.campaign.plan_file import PlanFile
    from dockair.scenarios.campaign.progress import CampaignProgress, show_campaign, show_dry_run
    from dockair.scenarios.campaign.run import run

    if plan is None:
        show_plans(as_json=as_json)
        return
    changes: dict[str, object] = {} if sampler is None else {"sampler": sampler.value}
    source = PlanFile(plan, changes | ({} if seeds is None else {"seeds": seeds}), overrides(settings))
    folder = out or default_folder(source.plan.name)
    if dry:
        with stdout_kept(as_json):
            planned = dry_run(source, folder, fresh=fresh, retry_errors=retry_errors).to_dict()
        print_json(planned) if as_json else show_dry_run(planned)
        return
    with stdout_kept(as_json), CampaignProgress() as progress:
        over = run(
            source,
            folder,
            workers=workers or len(os.sched_getaffinity(0)),
            fresh=fresh,
            retry_errors=retry_errors,
            watch=progress.begin,
        )
    if as_json:
        print_json(over.to_dict())
    else:
        show_campaign(over.to_dict())
    if over.verdict is not None and not over.verdict.passed:
        raise typer.Exit(1)


def show_plans(*, as_json: bool) -> None:
    """List the packaged plans and what each is there to show."""
    from dockair.scenarios.campaign.plan_file import PlanFile, plan_names

    claims = {name: PlanFile(name).plan.claim for name in plan_names()}
    if as_json:
        print_json({"plans": claims})
    else:
        for name, claim in claims.items():
            typer.echo(f"{name:<14}{claim}")
