"""The command `dockair design-ring`."""

from pathlib import Path
from typing import Annotated

import typer

from dockair.scenarios.commands.options import Json, print_json


def design_ring(
    rim: Annotated[str, typer.Option(help="Numbers of LEDs on the rim.")] = "6,8,12",
    inner: Annotated[str, typer.Option(help="Numbers of LEDs off the rim's plane.")] = "0,1,4",
    depth: Annotated[str, typer.Option(help="How far ahead of it, in metres; behind it when negative.")] = "0.1,0.2",
    diameter: Annotated[str, typer.Option(help="Diameters of the rim's circle, in metres.")] = "0.4,0.5,0.6",
    spacing: Annotated[str, typer.Option(help="equal, coded (one LED off its place), or equal,coded.")] = "equal",
    ranges: Annotated[str, typer.Option(help="Nearest and farthest of the approach, in metres.")] = "2,30",
    tilt: Annotated[float, typer.Option(help="Largest tilt of the drogue, in degrees.")] = 20.0,
    sigma_px: Annotated[float, typer.Option(help="Standard deviation of a pixel coordinate.")] = 0.1,
    camera: Annotated[Path | None, typer.Option(help="The camera's calibration, a TOML file.")] = None,
    by: Annotated[str, typer.Option(help="all (range, lateral, attitude), one of them, or camera.")] = "all",
    top: Annotated[int, typer.Option(min=1, help="Rings to show.")] = 12,
    trials: Annotated[int, typer.Option(min=0, max=100_000, help="Noisy frames to solve at each of some nodes.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for the picture; out/design-ring by default.")] = None,
    as_json: Json = False,
) -> None:
    """Compare rings of LEDs by the bound on the drogue's pose over the approach: a ranking and a picture."""
    from dockair.scenarios.commands.output import show_working
    from dockair.scenarios.design_ring import options
    from dockair.scenarios.design_ring import output as design
    from dockair.scenarios.output_folder import made_folder

    rings = options.rings_from_options(rim, inner, depth, diameter, spacing)
    corridor = options.corridor_from_options(ranges, tilt, sigma_px, camera)
    options.require_ranking(by)
    folder = made_folder(out or Path("out") / "design-ring")
    with show_working(f"comparing {len(rings)} rings"):
        ranking = options.ranking_from(rings, corridor, by)
        tried = design.trials_of(ranking, trials)
    picture = design.draw(ranking, folder)
    if as_json:
        print_json(ranking.to_dict(top) | {"trials": [node.to_dict() for node in tried], "picture": str(picture)})
    else:
        design.show_ranking(ranking, top)
        design.show_trials(tried)
        typer.echo(f"  {picture}")
