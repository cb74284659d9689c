"""How long what a command asks for takes, by how much that is in its file, before what does it is loaded."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .meant import meant
from .toml import load_toml, override

START = 10.0
"""s that every run takes: loading, compiling, pictures."""

EACH = {"modes": 1.7, "respond": 1.5e-2, "orbit": 1e-4, "mistune": 5e-2, "backbone": 20.0}
"""s on the core that `progress.PLANS` speaks of: of a speed, a nodal diameter and a megabyte of mesh; of a point, a
normal force and a coefficient of each coordinate; of a sample of a period; of such a point of a sample of a ring; of a
normal force."""

TOUCHING = 1.5e-4
"""s on it of each contact point besides, where laws are marched: measured of 720 rough ones, whose response takes eight
times as long as that of 48 smooth ones for as much else."""

MESH = 3.0
"""MB, of a mesh that is not there yet."""

SWEEPS = 4.0
"""That `optimum` takes, about."""

OF_BODIES = ("run", "modes", "mesh", "closure", "report", "stability")
"""What may be done to a body."""


def expected(words: Sequence[str]) -> float | None:
    """s that what these words of a command line ask for takes on that core; None where nothing counts it.

    Raises:
        UserError: there is no such file, or none that can be read.
    """
    verb, path, assignments = _parts(words)
    if path is None:
        return None
    if str(path) == "sample" and not path.exists():
        return None
    file = meant(path, case=verb not in OF_BODIES)
    kinds = ("body", "system", "case") if verb in OF_BODIES else ("case",)
    file = next((f for k in kinds if (f := file / f"{k}.toml").is_file()), file) if file.is_dir() else file
    if file.suffix != ".toml":
        return None
    table = override(load_toml(file), assignments, file)
    if verb in ("run", "modes") and "geometry" in table:
        cases = (file.with_name("case.toml"), Path("pipeline/cases") / f"{table.get('name')}.toml")
        case = next((f for f in cases if verb == "run" and f.is_file()), None)
        return _modes(table, file) + (_case("respond", load_toml(case)) or 0.0 if case else 0.0)
    return _case("respond" if verb == "run" else verb, table)


def _parts(words: Sequence[str]) -> tuple[str, Path | None, list[str]]:
    """Verb, the path that follows it, and what is set."""
    plain, assignments = list[str](), list[str]()
    for before, word in zip(["", *words], words, strict=False):
        if before == "--set" or word.startswith("--set="):
            assignments.append(word.removeprefix("--set="))
        elif not word.startswith("-"):
            plain.append(word)
    return plain[0] if plain else "", Path(plain[1]) if len(plain) > 1 else None, assignments


def _modes(table: dict[str, Any], file: Path) -> float:
    name, cyclic = table.get("name", ""), _table(table, "cyclic")
    named = (Path("meshes") / f"{name}.msh", file.parent / str(_table(table, "geometry").get("mesh", "")))
    mesh = next((f.stat().st_size / 1e6 for f in named if f.is_file()), MESH)
    asked = cyclic.get("nodal_diameters", "all")
    sectors = cyclic.get("sectors", 1)
    waves = len(asked) if isinstance(asked, list) else sectors // 2 + 1 if isinstance(sectors, int) and cyclic else 1
    return START + EACH["modes"] * _many(_table(table, "rotation").get("speeds_rpm")) * waves * mesh


def _case(verb: str, table: dict[str, Any]) -> float | None:
    sweep, harmonics = _table(table, "sweep"), table.get("harmonics")
    forces = _many(sweep.get("normal_forces"))
    waves = 2 * _number(harmonics, 3.0) + 1
    points = _number(sweep.get("points"), 600.0) * forces * waves
    points *= 1 + TOUCHING / EACH["respond"] * _touching(table)
    if verb == "optimum":
        return START + SWEEPS * EACH["respond"] * points
    if verb == "orbit":
        asked = _table(table, "orbit")
        periods = _number(asked.get("settle"), 300.0) + _number(asked.get("keep"), 40.0)
        each = max(_number(asked.get("samples"), 256.0), _number(asked.get("steps"), 0.0))
        return START + EACH[verb] * periods * each * max(_many(asked.get(k)) for k in ("frequency", "Omega"))
    if verb == "mistune":
        points *= _number(_table(table, "mistuning").get("samples"), 100.0) / 7
    amount = {"respond": points, "mistune": points, "backbone": forces}.get(verb)
    return None if amount is None else START + EACH[verb] * amount


def _table(table: dict[str, Any], key: str) -> dict[str, Any]:
    found = table.get(key)
    return found if isinstance(found, dict) else {}


def _touching(table: dict[str, Any]) -> float:
    """Contact points whose laws are marched."""
    contacts = table.get("contacts")
    if table.get("mode") == "book" or not isinstance(contacts, list):
        return 0.0
    asked = [c.get("points") for c in contacts if isinstance(c, dict)]
    return sum(_number(p[0], 1.0) * _number(p[1], 1.0) for p in asked if isinstance(p, list) and len(p) == 2)


def _many(value: Any) -> int:
    """Of a list; 1 of anything else."""
    return max(len(value), 1) if isinstance(value, list) else 1


def _number(value: Any, default: float) -> float:
    """What is no number is told by those who read it."""
    return float(value) if isinstance(value, int | float) and 0 < value < 1e30 else default
