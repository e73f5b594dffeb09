"""The command `dockair report`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from dockair.errors import DockairError
from dockair.scenarios.commands.options import Json, print_json


def report(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Folders of campaigns, over or not.")],
    out: Annotated[Path | None, typer.Option(help="HTML file; by default report.html in the first folder.")] = None,
    title: Annotated[str | None, typer.Option(help="Of the page; by default the campaigns' names.")] = None,
    evidence: Annotated[
        Path | None, typer.Option(help="A small JSON table beside it: counts, intervals, manifests; for a repository.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Make one self-contained HTML page of campaigns: rates with intervals, scatter, errors, causes of failure."""
    from dockair.scenarios.campaign.folder import REPORT, is_own_file
    from dockair.scenarios.output_folder import is_flights_file
    from dockair.scenarios.report import evidence as table
    from dockair.scenarios.report.folders import read_campaigns
    from dockair.scenarios.report.page import page
    from dockair.scenarios.whole_file import write_text

    out = out or folders[0] / REPORT
    if evidence is not None and os.path.realpath(evidence) == os.path.realpath(out):
        raise DockairError(f"--evidence {evidence}", expected="a file of its own", got="the page's")
    for option, path in (("--out", out), ("--evidence", evidence)):
        if path is not None and (is_own_file(path) or is_flights_file(path)):
            got = "a campaign's" if is_own_file(path) else "a flight's"
            raise DockairError(f"{option} {path}", expected="a file of its own", got=got)
    campaigns = read_campaigns(folders)
    title = title or ", ".join(campaign.name for campaign in campaigns)
    path = write_text(page(title, campaigns), out)
    found = table.evidence_of(campaigns)
    if evidence is not None:
        write_text(table.as_text(found), evidence)
    if as_json:
        print_json(found | {"out": str(path)})
    else:
        typer.echo(str(path))
