"""Every key that a scenario may set, for `dockair scenarios --keys` and docs/scenario_keys.md, from the tables in code.

python -m dockair.scenarios.commands.keys > docs/scenario_keys.md

Range and default are those that pydantic checks, the unit is the end of the name, the meaning the `#:` beside the key.
"""

import ast
import inspect
import sys
import textwrap
import types
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from dockair.errors import DockairError
from dockair.parameters import read_sheet, sheet_names
from dockair.scenarios.parameters_page import in_words
from dockair.scenarios.refusal import Expected, inner_model
from dockair.scenarios.schema import Scenario

_UNITS = {"_m_s": "m/s", "_deg_s": "deg/s", "_m": "m", "_s": "s", "_us": "us", "_hz": "Hz", "_deg": "deg"}
_MARK = "#:"  # begins the comment that says what a key means
_RANGES = {bool: "true, false", str: "text", float: "a number", int: "an integer"}
_PARAMETERS = "Any number of any parameter sheet, inside its range."
_LARGEST_PLAIN = 1e6  # an integer above is told by its power of two
_COLUMNS = 118  # of the page

#: What else there is to say of a table on the page.
_MORE = {
    "gusts": "An array of tables, `[[gusts]]`, one a gust.",
    "faults": "An array of tables, `[[faults]]`, one a fault. Which kind has which keys: [faults](faults.md).",
    "start": "A start far aside is no [departure](results.md#unsafe); going much farther off from there is one.",
    "navigation": "[A navigator of one's own](tutorials/own_navigator.md), [heading](heading.md).",
    "guidance": "What the phases do with these: [guidance](guidance.md).",
    "parameters": "Sheets, keys and ranges: [parameters](parameters.md).",
    "accept": "How flights are held to these: [acceptance](scenarios.md#acceptance).",
}
_HEAD = """\
# Keys of a scenario

Every key that a scenario's file may have and that `--set KEY=VALUE` may change. This page is made from the tables in
`scenarios/schema.py` and the files that it joins, and not edited by hand:

    python -m dockair.scenarios.commands.keys > docs/scenario_keys.md

`dockair scenarios --keys` shows the same on the screen, `dockair scenarios --keys sun` the keys with "sun" in them,
those of the [parameter sheets](parameters.md) among them.

{defaults}

A key stands in its table: `sun.azimuth_deg` is `azimuth_deg` under `[sun]` in the file, `--set sun.azimuth_deg=80` on
the command line. An array of tables is set whole, `--set 'faults=[{{kind="dead_reel"}}]'`; one that is there, by an
entry's place from 0 on, too: `--set 'faults[0].start_s=8'`. A key without a default is one that its table must
have; "none" means that nothing is given or asked for. In the file, texts stand in quotes.

Gains of guidance and of the filter are no keys of a scenario: they stand, with their reasons, in
`nav/guidance/guidance_settings.py` and `nav/fusion_settings.py`.
"""


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a scenario, in words."""

    table: str  #: its table's name, "" outside all tables
    name: str  #: dotted, as `--set` takes it; `[]` after an array of tables
    unit: str
    range: str
    default: str  #: "" where there is none
    meaning: str


def scenario_keys(part: str = "") -> list[Key]:
    """Return the keys in the order of the tables; where a part is asked for, those of the parameter sheets, too.

    Args:
        part: what the dotted name must contain.

    Raises:
        DockairError: no key contains it.
    """
    sheets = [key for sheet in sheet_names() for key in _keys_of_sheet(sheet)] if part else []
    keys = [key for key in [*_keys_of(Scenario, "", ""), *sheets] if part in key.name]
    if not keys:
        exists = sorted({key.table or key.name for key in _keys_of(Scenario, "", "")})
        raise DockairError("--keys", expected="a part of a key's name", got=part, exists=exists)
    return keys


def keys_page() -> str:
    """Return the whole page as Markdown."""
    keys = scenario_keys()
    tables = list(dict.fromkeys(key.table for key in keys))
    index = " · ".join(f"[{table}](#{table})" for table in tables if table)
    sections = [_section(table, [key for key in keys if key.table == table]) for table in tables]
    return "\n".join([_HEAD.format(defaults=_defaults()), index, *sections]) + "\n"


def _defaults() -> str:
    """What a file flies that has a name and nothing else."""
    s = Scenario(name="name")
    still = "still air" if s.turbulence.model == "none" and not s.gusts else "gusts"
    wake, wave = ("with" if table.present else "without" for table in (s.wake, s.bow_wave))
    words = (
        f"Only `name` is required. A file with nothing else flies in {still}, {wake} the tanker's wake and {wave} the "
        f"receiver's bow wave, at {s.flight.airspeed_m_s:g} m/s and {s.flight.altitude_m:g} m behind a tanker that "
        f"flies {s.tanker.manoeuvre}; from {s.start.aft_m:g} m astern, for at most {s.flight.duration_s:g} s, by "
        f"camera (`{s.camera.sensing}`), without clouds, the Sun at azimuth {s.sun.azimuth_deg:g} and elevation "
        f"{s.sun.elevation_deg:g} degrees; with up to {s.guidance.attempts_max} attempts at "
        f"{s.guidance.closure_speed_m_s:g} m/s and {s.guidance.hold_s:g} s on the probe. It claims no figures; nothing "
        "unsafe is asked of it as of any (`accept.unsafe_max`). The scenario `default` of the "
        "[library](scenarios.md#the-library) has more in its file, gusts among it."
    )
    return textwrap.fill(words, _COLUMNS, break_long_words=False, break_on_hyphens=False)


def _section(table: str, keys: Sequence[Key]) -> str:
    head = ["| key | unit | range | default | meaning |", "|---|---|---|---|---|"]
    title = ["", f"## {table}", "", _introduction(table), ""] if table else [""]
    return "\n".join([*title, *head, *(_row(key) for key in keys)])


def _introduction(table: str) -> str:
    inner = inner_model(Scenario.model_fields[table])
    words = inspect.cleandoc(inner.__doc__ or "") if inner is not None else _PARAMETERS
    return f"{words} {_MORE.get(table, '')}".strip()


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.unit, key.range, key.default, key.meaning)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _keys_of(table: type[BaseModel], prefix: str, outermost: str) -> list[Key]:
    """The keys of a table and of those in it."""
    meanings, keys = _meanings(table), []
    for name, field in table.model_fields.items():
        inner = inner_model(field)
        where = f"{prefix}{name}"
        if inner is not None:
            is_array = get_origin(field.annotation) is tuple
            keys += _keys_of(inner, f"{where}[]." if is_array else f"{where}.", outermost or name)
        elif get_origin(field.annotation) is dict:  # [parameters.<sheet>], whose keys are the sheet's
            own = "the sheet's own"
            keys.append(Key(name, f"{where}.<sheet>.<key>", "", own, own, "in place of the sheet's value"))
        else:
            keys.append(Key(outermost, where, _unit(name), _range(field), _default(field), meanings.get(name, "")))
    return keys


def _keys_of_sheet(sheet: str) -> list[Key]:
    """The keys of a parameter sheet, where their values come from in the place of a meaning."""
    keys = []
    for name, parameter in read_sheet(sheet).items():
        value, span = in_words(parameter)
        unit = "" if parameter.unit == "1" else parameter.unit
        told = f"{parameter.status}: {parameter.source}"
        keys.append(Key("parameters", f"parameters.{sheet}.{name}", unit, span, value, told))
    return keys


def _meanings(table: type[BaseModel]) -> dict[str, str]:
    """Key -> the `#:` comment on its lines, or on those right above it."""
    source = inspect.getsource(table)
    lines = source.splitlines()
    body = ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    found = {}
    for node in body.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        assert node.end_lineno is not None
        above = node.lineno - 1
        while lines[above - 1].strip().startswith(_MARK):
            above -= 1
        own = lines[node.end_lineno - 1].encode()[node.end_col_offset :].decode()
        comments = [*lines[above : node.lineno - 1], own]
        found[node.target.id] = " ".join(text.partition(_MARK)[2].strip() for text in comments if _MARK in text)
    return {name: _in_a_cell(text) for name, text in found.items()}


def _in_a_cell(sentence: str) -> str:
    """A comment of a line of its own is a sentence; "MIL" stays."""
    begins = sentence[:1].lower() if sentence[1:2].islower() else sentence[:1]
    return begins + sentence[1:].removesuffix(".")


def _unit(name: str) -> str:
    return next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "")


def _range(field: FieldInfo) -> str:
    kind = _kind(field.annotation)
    for item in field.metadata:
        if isinstance(item, Expected):
            return item.text
    if get_origin(kind) is Literal:
        return ", ".join(str(value) for value in get_args(kind))
    bounds = {
        name: getattr(item, name) for item in field.metadata for name in ("gt", "ge", "le") if hasattr(item, name)
    }
    low = f"above {_number(bounds['gt'])}" if "gt" in bounds else _number(bounds["ge"]) if "ge" in bounds else ""
    if "le" in bounds:
        return f"{low}{', up' if 'gt' in bounds else ''} to {_number(bounds['le'])}".strip()
    if low:
        return low if "gt" in bounds else f"{low} or more"
    return _RANGES[kind]


def _kind(annotation: Any) -> Any:
    """The type of a key's value, None apart."""
    if get_origin(annotation) is Annotated:
        return _kind(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return next(kind for kind in get_args(annotation) if kind is not type(None))
    return annotation


def _default(field: FieldInfo) -> str:
    return "" if field.is_required() else _value(field.default)


def _value(value: Any) -> str:
    if value is None or value == "":
        return "none"
    if isinstance(value, tuple):
        return ", ".join(_value(v) for v in value)
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else _number(value)


def _number(number: float) -> str:
    if isinstance(number, int) and number > _LARGEST_PLAIN:
        return f"2^{number.bit_length()} - 1"
    return str(number) if isinstance(number, int) else format(number, ".6g")


if __name__ == "__main__":
    sys.stdout.write(keys_page())
