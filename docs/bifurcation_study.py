"""Pictures and the table of docs/bifurcation.md: the two masses on a belt of section 4.4."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from pathlib import Path

from matplotlib.axes import Axes

import microslip as ms
from microslip.bifurcation.branches import draw
from microslip.case import load_case
from microslip.stages.analysing import analysed
from microslip.stages.answer import CaseJob
from microslip.stages.places import modal_files

ROOT = Path(__file__).resolve().parents[1]
CASE = ROOT / "pipeline" / "cases" / "belt.toml"

SHOWN = {"load": "load parameter B in m", "velocity": "belt velocity in m/s", "damping": "damping D"}
"""Diagrams of the case and what their axes say."""

Row = dict[str, str]


def followed(folder: Path, report: Callable[[str], None]) -> list[Path]:
    """The case's diagrams; their files."""
    settings, _ = load_case(CASE)
    files = modal_files(settings, CASE, ROOT, report)
    return list(analysed("bifurcation", CaseJob(CASE, files, folder, report=report)).files)


def panels(folder: Path, places: Iterable[Axes]) -> None:
    """The diagrams of the case, without the names of their branches."""
    found = ms.read_bifurcation(folder / "bifurcation.h5")
    for axes, (name, words) in zip(places, SHOWN.items(), strict=True):
        draw(found[name].branches, [], axes, words)
        axes.get_legend().remove()
        axes.set_ylabel("amplitude in m")


def rows(folder: Path, name: str) -> list[Row]:
    """Of the table of a diagram."""
    with open(folder / f"bifurcation_{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def points(table: list[Row], branch: str, kind: str) -> list[float]:
    return [float(row["parameter"]) for row in table if row["branch"] == branch and row["kind"] == kind]


def compared(folder: Path) -> tuple[list[str], list[list[str]]]:
    """Head and rows: printed and found values."""
    load, velocity = rows(folder, "load"), rows(folder, "velocity")
    one, other = "orbits 1", "orbits 2"
    still, window = points(load, "equilibria", "Hopf"), points(velocity, "attractor 1 at 3.8", "fold")
    found = [
        ("H1, Hopf point, subcritical", "m", 1.12, still[0]),
        ("T1, turning point", "m", 0.88, points(load, one, "fold")[0]),
        ("H2, Hopf point", "m", 7.09, still[1]),
        ("first period doubling", "m", 8.09, points(load, one, "period doubling")[0]),
        ("second", "m", 9.26, points(load, f"{one} doubled 1", "period doubling")[0]),
        ("third", "m", 9.36, points(load, f"{one} doubled 1 doubled 1", "period doubling")[0]),
        ("coexisting orbit becomes stable", "m", 7.25, points(load, other, "period doubling")[-1]),
        ("three attractors, from", "m/s", 3.57, min(window)),
        ("three attractors, to", "m/s", 4.09, max(window)),
    ]
    head = ["", "unit", "printed", "found", "difference"]
    return head, [[n, u, f"{p:g}", f"{x:.5g}", f"{100 * (x / p - 1):+.2f} %"] for n, u, p, x in found]
