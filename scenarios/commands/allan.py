"""The command `dockair allan`."""

from pathlib import Path
from typing import Annotated

import typer

from dockair.errors import DockairError
from dockair.scenarios.commands.options import Json, print_json


def allan(
    record: Annotated[Path, typer.Argument(metavar="RECORD", help="CSV or NPY of a gyro's rates at rest.")],
    rate_hz: Annotated[float, typer.Option(min=1e-3, max=1e6, help="Of the record's samples.")],
    unit: Annotated[str | None, typer.Option(help="rad/s or deg/s, if the columns' names do not say.")] = None,
    terms: Annotated[str, typer.Option(help="Which of Q, N, B, K to look for.")] = "QNBK",
    bias_correlation_s: Annotated[
        float | None, typer.Option(min=1e-3, max=1e7, help="Of the bias, where it is known.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Parameter sheet to write.")] = None,
    as_json: Json = False,
) -> None:
    """Identify a gyro's noise terms by Allan deviation; write them as a parameter sheet."""
    from dockair.scenarios import allan_tool

    if out is not None and out.exists() and record.exists() and out.samefile(record):
        raise DockairError("--out", expected="another file than the record", got=str(out))
    found = allan_tool.report(record, rate_hz, unit, terms=terms, bias_correlation_s=bias_correlation_s)
    if out is not None:
        allan_tool.write_sheet(found, out)
    if as_json:
        print_json(found.to_dict())
    else:
        typer.echo(allan_tool.in_words(found))
