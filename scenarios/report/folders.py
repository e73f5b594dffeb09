"""What a report reads: the rows and the manifest of each campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.folder import rows_of
from dockair.scenarios.campaign.manifest import read_manifest
from dockair.scenarios.report.groups import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """One folder."""

    name: str
    manifest: Mapping[str, Any]
    rows: Sequence[Row]


def read_campaigns(folders: Sequence[Path]) -> list[Campaign]:
    """Return the campaigns in the folders' order.

    Raises:
        DockairError: no campaign there, no flight done yet, or the same flight in two of them.
    """
    campaigns = []
    for folder in folders:
        manifest = read_manifest(folder)
        rows = rows_of(folder)
        if not rows:
            raise DockairError(str(folder), expected="a campaign with at least one flight done", got="none")
        campaigns.append(Campaign(name=str(manifest["plan"]["name"]), manifest=manifest, rows=rows))
    _refuse_twins(campaigns)
    return campaigns


def _refuse_twins(campaigns: Sequence[Campaign]) -> None:
    """A flight that two campaigns have flown would count twice."""
    seen: dict[tuple[str, int], str] = {}
    for campaign in campaigns:
        for row in campaign.rows:
            flight = str(row["scenario_hash"]), int(row["seed"])
            if flight in seen:
                expected = "campaigns without a flight in common"
                got = f"{row['scenario']}, seed {row['seed']}, in {seen[flight]} and {campaign.name}"
                raise DockairError("FOLDER...", expected=expected, got=got)
            seen[flight] = campaign.name
