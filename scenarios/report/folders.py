"""What a report reads: the rows and the manifest of each campaign."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dockair.errors import DockairError
from dockair.scenarios.campaign.folder import default_folder, rows_of
from dockair.scenarios.campaign.manifest import FILE_NAME, read_manifest
from dockair.scenarios.output_folder import FLIGHT_FILES
from dockair.scenarios.report.groups import Row, groups_of
from dockair.scenarios.report.settings import drawn_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """One folder."""

    name: str
    manifest: Mapping[str, Any]
    rows: Sequence[Row]


def read_campaigns(folders: Sequence[Path]) -> list[Campaign]:
    """Return the campaigns in the folders' order.

    Raises:
        DockairError: no campaign there (but a flight, a file), no flight done yet, two that were not flown by the same
            code, another scenario under the same name, or the same flight in two of them.
    """
    campaigns = []
    for folder in folders:
        _refuse_what_is_no_campaign(folder)
        manifest = read_manifest(folder)
        rows = rows_of(folder)
        if not rows:
            raise DockairError(str(folder), expected="a campaign with at least one flight done", got="none")
        campaigns.append(Campaign(name=str(manifest["plan"]["name"]), manifest=manifest, rows=rows))
    _require_one_code(folders, campaigns)
    _refuse_namesakes(folders, campaigns)
    _refuse_twins(folders, campaigns)
    return campaigns


def _refuse_what_is_no_campaign(folder: Path) -> None:
    """Say of a flight's folder, or of a file, what it is: neither has a manifest, which says little to who gave it."""
    expected = "the folder of a campaign, which `dockair campaign PLAN` makes"
    by_plan = default_folder(str(folder))
    if not os.path.exists(folder) and os.path.isdir(by_plan):  # given by its plan's name
        raise DockairError(str(folder), expected=expected, got="no folder", exists=(str(by_plan),))
    if os.path.isfile(folder):  # Path.is_file raises where a name is too long
        raise DockairError(str(folder), expected=expected, got="a file")
    present = any(os.path.isfile(folder / name) for name in FLIGHT_FILES)
    if present and not os.path.isfile(folder / FILE_NAME):
        got = "the folder of one flight; what came of it is in its result.json and flight.png"
        raise DockairError(str(folder), expected=expected, got=got)


def _require_one_code(folders: Sequence[Path], campaigns: Sequence[Campaign]) -> None:
    """Rows of two codes are no group, and to hold one beside the other would be to compare the codes."""
    seen: dict[str, tuple[str, Path]] = {}
    for folder, campaign in zip(folders, campaigns, strict=True):
        for what, value in _flown_by(campaign.manifest).items():
            earlier, where = seen.setdefault(what, (value, folder))
            if value != earlier:
                expected = "campaigns of the same code; others have a report of their own"
                got = f"{what} {earlier} in {where}, {value} in {folder}"
                raise DockairError("FOLDER...", expected=expected, got=got)


def _flown_by(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Return what must not differ, as of one campaign; a background only where scenarios left it to the machine."""
    plug_ins = {f"navigator {module}": digest for module, digest in manifest.get("plug_ins", {}).items()}
    versions = ", ".join(f"{name} {version}" for name, version in sorted(manifest.get("versions", {}).items()))
    found = {"code": manifest.get("code"), "background": manifest.get("background"), "versions": versions} | plug_ins
    return {what: value for what, value in found.items() if value}


def _refuse_namesakes(folders: Sequence[Path], campaigns: Sequence[Campaign]) -> None:
    """Flights are pooled by the scenario's name; a file that was edited between two campaigns is another scenario.

    Manifests say what the files held. Older ones do not; there the digest of a flight tells, but where keys are drawn.
    """
    expected = "one content of a scenario's name; of others a report each, or another name"
    seen: dict[str, tuple[str, Path]] = {}
    for folder, campaign in zip(folders, campaigns, strict=True):
        for name, digest in campaign.manifest.get("files", {}).items():
            earlier, where = seen.setdefault(name, (digest, folder))
            if digest != earlier:
                raise DockairError("FOLDER...", expected=expected, got=f"{name} in {where}, another in {folder}")
    first: dict[tuple[str, ...], tuple[str, str]] = {}
    for folder, campaign in zip(folders, campaigns, strict=True):
        for group in groups_of(campaign.rows):
            for row in (row for row in group.rows if not drawn_of(row)):
                flown = f"{row['command']} in {folder}"
                digest, before = first.setdefault(tuple(group.kind.values()), (row["scenario_hash"], flown))
                if row["scenario_hash"] != digest:
                    raise DockairError("FOLDER...", expected=expected, got=f"{before}, another scenario by {flown}")


def _refuse_twins(folders: Sequence[Path], campaigns: Sequence[Campaign]) -> None:
    """A flight that two campaigns have flown would count twice."""
    seen: dict[tuple[str, int], Path] = {}
    for folder, campaign in zip(folders, campaigns, strict=True):
        for row in campaign.rows:
            flight = str(row["scenario_hash"]), int(row["seed"])
            if flight in seen:
                expected = "campaigns without a flight in common"
                got = f"{row['scenario']}, seed {row['seed']}, in {seen[flight]} and {folder}"
                raise DockairError("FOLDER...", expected=expected, got=got)
            seen[flight] = folder
