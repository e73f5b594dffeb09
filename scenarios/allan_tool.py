"""Noise terms of a gyro from a record at rest, and the parameter sheet that they make: `dockair allan`.

A record is a CSV file, with or without a line of names, or a NumPy file; each column is one gyro, or one axis of it,
and all count as units of the same kind. A column whose name begins with "time" or "stamp" is left out. The unit is
rad/s or deg/s, as the names say ("x [deg/s]", "gyro_x_deg_s") or as the caller does.

Not modelled: gaps and jitter of the record's own stamps; temperature. What cannot be told from a record that is short
beside the bias's correlation time is said in `nav/heading/allan`.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.errors import DockairError
from dockair.nav.heading.allan import GyroNoise, identify_gyro_noise
from dockair.parameters import read_sheet
from dockair.rotations import Array
from dockair.scenarios.toml_files import toml_text
from dockair.scenarios.whole_file import write_text

UNITS = {"rad/s": 1.0, "deg/s": float(np.pi / 180.0)}  #: in rad/s
#: Whole units alone: "mdeg/s" is a thousandth of one, "rad/s^2" and "rad_s2" no rate.
_NAMED = {f"{angle}/s": re.compile(rf"(?<![a-z]){angle}[/_]s(?![a-z0-9²^]|\*\*)") for angle in ("rad", "deg")}
_SHEET = "imu_mti"  # whose keys, units and ranges are written
_SHORT_S = 10.0  # a record shorter than this holds too few of the second at which N is read
_LONG = 10.0  # correlation times that a record should last for B and K to be told apart
_OPTIONS = {"sample_rate_hz": "--rate-hz", "bias_correlation_s": "--bias-correlation-s", "terms": "--terms"}
_SUFFIXES = (".csv", ".txt", ".npy")
_DEG_H = 3600.0 * 180.0 / np.pi  # in a rad/s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AllanReport:
    """What a record shows."""

    record: str
    samples: int
    columns: int
    rate_hz: float
    noise: GyroNoise
    dropped_correlation_s: float  #: of a bias that fitted best but that no sheet holds, and was left out; else NaN

    @property
    def duration_s(self) -> float:
        """Of the record."""
        return self.samples / self.rate_hz

    @property
    def parameters(self) -> dict[str, float]:
        """The sheet's keys and their measured values; without bias instability its correlation time is left out."""
        n = self.noise
        found = {
            "gyro_noise_density_rad_s_rthz": n.noise_density_rad_s_rthz,
            "gyro_bias_instability_rad_s": n.bias_instability_rad_s,
            "gyro_bias_correlation_s": n.bias_correlation_s,
            "gyro_rate_random_walk_rad_s_rts": n.rate_random_walk_rad_s_rts,
        }
        return {key: value for key, value in found.items() if np.isfinite(value)}

    @property
    def caution(self) -> str:
        """What the record does not tell; nothing if it tells all."""
        if self.duration_s < _SHORT_S:
            return (
                f"{self.duration_s:.2g} s are less than ten times the 1 s at which N is read: all terms are uncertain"
            )
        T = self.noise.bias_correlation_s
        if np.isfinite(self.dropped_correlation_s):
            return f"no bias instability: what fits best wanders within {self.dropped_correlation_s:.2g} s"
        if not np.isfinite(T) or self.duration_s >= _LONG * T:
            return ""
        return f"{self.duration_s:.0f} s are less than {_LONG:.0f} correlation times: B, its time and K are uncertain"

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "record": self.record,
            "samples": self.samples,
            "columns": self.columns,
            "rate_hz": self.rate_hz,
            "duration_s": self.duration_s,
            "quantisation_rad": self.noise.quantisation_rad,
            "parameters": self.parameters,
            "caution": self.caution,
        }


def report(
    path: Path, rate_hz: float, unit: str | None = None, *, terms: str = "QNBK", bias_correlation_s: float | None = None
) -> AllanReport:
    """Read a record and identify its terms.

    Args:
        path: of the record.
        rate_hz: of its samples.
        unit: of its numbers, if its names do not say.
        terms: which of Q, N, B, K to look for.
        bias_correlation_s: where it is known.

    Raises:
        DockairError: a file, unit, rate or term that cannot be; a record that is too short or not finite.
    """
    rates = read_record(path, unit)
    try:
        noise = identify_gyro_noise(rates, rate_hz, bias_correlation_s=bias_correlation_s, terms=terms)
    except DockairError as error:
        where = str(path) if error.where == "rates" else _OPTIONS.get(error.where, error.where)
        raise error.at(where) from None
    range_s, T = read_sheet(_SHEET)["gyro_bias_correlation_s"], noise.bias_correlation_s
    dropped_s = T if T < range_s.low or T > range_s.high else float("nan")  # no in-run bias that a sheet could hold
    if np.isfinite(dropped_s):
        others = terms.replace("B", "")
        noise = identify_gyro_noise(rates, rate_hz, terms=others) if others else _without_terms(noise)
    return AllanReport(
        record=path.name,
        samples=len(rates),
        columns=rates.shape[1],
        rate_hz=rate_hz,
        noise=noise,
        dropped_correlation_s=dropped_s,
    )


def _without_terms(noise: GyroNoise) -> GyroNoise:
    """Return what is left of a bias that was looked for alone."""
    nothing = np.zeros_like(noise.fitted_rad_s)
    return replace(noise, bias_instability_rad_s=0.0, bias_correlation_s=float("nan"), fitted_rad_s=nothing)


def read_record(path: Path, unit: str | None = None) -> Array:
    """(n, m) rates [rad/s] of a record's columns.

    Raises:
        DockairError: no such file, no numbers in it, no unit or two of them.
    """
    if unit is not None and unit not in UNITS:
        raise DockairError("--unit", expected="a unit of angular rate", got=unit, exists=tuple(UNITS))
    if path.suffix.lower() not in _SUFFIXES:
        raise DockairError(str(path), expected="a CSV or NumPy file", got=path.suffix or "no suffix", exists=_SUFFIXES)
    if not os.path.isfile(path):  # Path.is_file raises where a name is too long, until Python 3.14
        raise DockairError(str(path), expected="a record of gyro rates", got="no such file")
    names, rates = _read_npy(path) if path.suffix.lower() == ".npy" else _read_csv(path)
    kept = [k for k in range(rates.shape[1]) if not names or not names[k].lower().startswith(("time", "stamp"))]
    if not kept:
        raise DockairError(str(path), expected="a column of rates", got=names)
    return np.asarray(rates[:, kept] * UNITS[_unit(path, [names[k] for k in kept] if names else [], unit)])


def sheet_text(found: AllanReport) -> str:
    """The gyro's part of a parameter sheet.

    Raises:
        DockairError: a term beyond the sheet's range, as a wrong unit or rate makes.
    """
    entries = []
    for key, value in found.parameters.items():
        p = read_sheet(_SHEET)[key]
        if not p.low <= value <= p.high:
            raise DockairError(key, expected=f"a number in [{p.low}, {p.high}] {p.unit}", got=value)
        source = (
            f"Allan deviation of {found.record}: {found.columns} x {found.duration_s:.0f} s at {found.rate_hz:g} Hz"
        )
        entries.append(
            f"[{key}]\nvalue = {value:.6g}\nlow = {p.low}\nhigh = {p.high}\n"
            f'unit = "{p.unit}"\nsource = {toml_text(_readable(source))}\nstatus = "measured"\n'
        )
    return "\n".join(entries)


def write_sheet(found: AllanReport, path: Path) -> None:
    """Write `sheet_text`.

    Raises:
        DockairError: see there; a place that cannot be written to.
        MachineError: there is no room.
    """
    write_text(sheet_text(found), path)


def scenario_text(found: AllanReport) -> str:
    """The same as a scenario takes it."""
    lines = [f"{key} = {value:.6g}" for key, value in found.parameters.items()]
    return "\n".join([f"[parameters.{_SHEET}]", *lines])


def in_words(found: AllanReport) -> str:
    """The terms, and what a scenario takes of them."""
    n = found.noise
    in_deg_h = n.bias_instability_rad_s * _DEG_H
    lines = [
        f"{found.record}: {found.columns} column(s) of {found.duration_s:.0f} s at {found.rate_hz:g} Hz",
        f"  Q  quantisation       {n.quantisation_rad:.4g} rad",
        f"  N  angle random walk  {n.noise_density_rad_s_rthz:.4g} rad/s/sqrt(Hz)",
        f"  B  bias instability   {n.bias_instability_rad_s:.4g} rad/s ({in_deg_h:.3g} deg/h)",
        f"     its correlation    {n.bias_correlation_s:.4g} s" if n.bias_instability_rad_s else "",
        f"  K  rate random walk   {n.rate_random_walk_rad_s_rts:.4g} rad/s/sqrt(s)",
    ]
    lines += [f"  {found.caution}"] if found.caution else []
    return "\n".join([*filter(None, lines), "", scenario_text(found)])


def _read_npy(path: Path) -> tuple[list[str], Array]:
    try:
        rates = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise DockairError(str(path), expected="a NumPy array of numbers", got=str(error)) from None
    if not isinstance(rates, np.ndarray) or rates.ndim not in (1, 2) or rates.dtype.kind not in "fiu":
        got = f"{rates.dtype} {rates.shape}" if isinstance(rates, np.ndarray) else type(rates).__name__
        raise DockairError(str(path), expected="(n,) or (n, m) real numbers", got=got)
    rates = rates.astype(float)
    return [], rates[:, None] if rates.ndim == 1 else rates


def _read_csv(path: Path) -> tuple[list[str], Array]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise DockairError(str(path), expected="a text file in UTF-8", got="other bytes") from None
    first = lines[0].strip().lstrip("#").strip() if lines else ""
    names = [name.strip().strip('"') for name in first.split(",")]
    named = not all(_is_number(name) for name in names)
    rows = lines[int(named) :]
    try:
        if not any(row.strip() for row in rows):
            raise ValueError("no rows of numbers")
        rates = np.loadtxt(rows, delimiter=",", ndmin=2)
    except ValueError as error:
        raise DockairError(str(path), expected="rows of numbers with commas", got=str(error)) from None
    if named and len(names) != rates.shape[1]:
        raise DockairError(str(path), expected=f"{rates.shape[1]} names", got=names)
    return names if named else [], rates


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unit(path: Path, names: Sequence[str], asked: str | None) -> str:
    said = {unit for name in names for unit, pattern in _NAMED.items() if pattern.search(name.lower())}
    if asked is not None:
        said.add(asked)
    if len(said) > 1:
        raise DockairError(f"{path}: unit", expected="one unit", got=sorted(said))
    if not said:
        raise DockairError(
            f"{path}: unit", expected="--unit, or names that say it", got=list(names), exists=tuple(UNITS)
        )
    return said.pop()


def _readable(text: str) -> str:
    """Return a text with a sign in place of what is no UTF-8, as a file's name may be."""
    return text.encode(errors="surrogateescape").decode(errors="replace")
