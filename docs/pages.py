"""What keeps these pages true: tables made by program, examples that are run, references of settings and files.

Marks in a page:

    <!-- table NAME --> ... <!-- end -->     filled in by make_pictures.py
    <!-- file PATH -->                       the fenced block that follows is written to PATH
    <!-- run -->                            the lines of the block that follows are typed into a shell
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import microslip
from microslip.case.settings import case_model
from microslip.contact.kinds import Kind
from microslip.contact.settings import ContactFile, Temperature
from microslip.data import (
    Compliance,
    ContactState,
    GyroscopicModes,
    Interface,
    Invariants,
    Mesh,
    ModalBasis,
    ModalGroup,
    Residual,
    Rows,
    RunUp,
    SpeedRange,
    StressSet,
)
from microslip.files.declared import declared
from microslip.rolling.settings import RollingCase
from microslip.rolling.tyre import TyreCase
from microslip.settings.body import BodySettings
from microslip.settings.numbers import keys_of
from microslip.system.settings import SystemSettings
from microslip.vehicle.settings import KinematicsCase, VehicleCase

HERE = Path(__file__).parent
BLOCK = re.compile(r"<!-- (file|run)(?: ([^\n]*?))? -->\n+```\w*\n(.*?)```", re.S)


def fill(page: str, name: str, text: str) -> None:
    """Put `text` between the marks ``<!-- table NAME -->`` and ``<!-- end -->`` of a page."""
    path = HERE / page
    old = path.read_text(encoding="utf-8")
    place = re.compile(rf"(<!-- table {name} -->\n).*?(<!-- end -->)", re.S)
    new, count = place.subn(lambda m: f"{m[1]}{text.strip()}\n{m[2]}", old)
    if count != 1:
        raise SystemExit(f"{page}: has {count} places for the table '{name}'")
    if new != old:
        path.write_text(new, encoding="utf-8")


def filled(page: str, name: str) -> str:
    """What stands between the marks now."""
    found = re.search(rf"<!-- table {name} -->\n(.*?)<!-- end -->", (HERE / page).read_text(encoding="utf-8"), re.S)
    assert found, f"{page} has no table {name}"
    return found[1].strip()


def table(head: list[str], rows: list[list[Any]]) -> str:
    """A Markdown table; columns that begin with a bare number, or one with its unit, are aligned right."""
    right = ["---:" if re.fullmatch(r"[-+]?[\d.e-]+( \S{1,3})?", str(v)) else "---" for v in rows[0]]
    lines = [head, right, *[[str(v) for v in row] for row in rows]]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


# examples ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Step:
    """A file to write (`path`) or lines to type."""

    path: str
    text: str


def steps(page: str) -> Iterator[Step]:
    """The examples of a page in order."""
    for kind, more, text in BLOCK.findall((HERE / page).read_text(encoding="utf-8")):
        yield Step(more if kind == "file" else "", text)


def play(
    page: str, folder: Path, more: Mapping[str, str] | None = None, type_in: Callable[[str, Path], str] | None = None
) -> str:
    """Do what a page says in an empty folder, with this Python's `microslip`; returns what the commands printed.

    more: words to add to lines that begin so. type_in: runs a line in the folder, `typed` if not given.

    Raises:
        RuntimeError: a command failed.
    """
    shown = []
    for step in steps(page):
        if step.path:
            (folder / step.path).parent.mkdir(parents=True, exist_ok=True)
            (folder / step.path).write_text(step.text, encoding="utf-8")
        else:
            lines = [line for line in step.text.splitlines() if line and not line.startswith("#")]
            shown += [(type_in or typed)(" ".join([line, *added(line, more or {})]), folder) for line in lines]
    return "\n".join(shown)


def added(line: str, more: Mapping[str, str]) -> list[str]:
    return [words for begin, words in more.items() if line.startswith(begin)]


def typed(line: str, folder: Path) -> str:
    """Run one line in a shell."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{line}\n{done.stdout}{done.stderr}")
    return f"$ {line}\n{done.stdout}"


def keywords() -> str:
    """Table of the keywords of decks, from the readers."""
    from microslip.mesh import bdf, cdb, deck_state, inp

    def words(names: Any, mark: str = "") -> str:
        return " ".join(f"`{mark}{name}`" for name in sorted({*names}))

    ansys = cdb._COMMANDS.items()
    refused = {name for name, meaning in ansys if meaning and (not callable(meaning) or meaning is cdb._generated)}
    rows = [
        [
            "Abaqus, CalculiX",
            words({*inp.READERS, *inp._LINKING} - deck_state._OTHER_STATES, "*"),
            words({*inp._REFUSED, *deck_state._OTHER_STATES}, "*"),
        ],
        ["Ansys", words({name for name, meaning in ansys if callable(meaning)} - refused), words(refused)],
        ["Nastran", words({*bdf._READ, *bdf.LOADS}), words(bdf.OTHERS)],
    ]
    return table(["deck", "read", "not read: refused or said"], rows)


# references ---------------------------------------------------------------------------------------


def public_reference() -> str:
    """Table of the public names, by the module that they are from."""
    from_modules = microslip.PUBLIC.items()
    rows = [[f"`{module}`", ", ".join(f"`{name}`" for name in names.split())] for module, names in from_modules]
    return table(["from", "`ms.` names"], rows)


FILES: dict[str, tuple[str, Any]] = {
    "body_toml": ("body_toml.md", BodySettings),
    "contact_toml": ("contact_toml.md", ContactFile),
    "case_toml": ("case_toml.md", case_model()),
    "system_toml": ("system_toml.md", SystemSettings),
    "wheel_on_rail": ("rolling_toml.md", RollingCase),
    "tyre": ("rolling_toml.md", TyreCase),
    "vehicle": ("rolling_toml.md", VehicleCase),
    "kinematics": ("rolling_toml.md", KinematicsCase),
}
"""Table -> its page, and the model that reads the file."""


def file_reference(name: str) -> str:
    """Tables of every key of a settings file, made from the models that read it."""
    page, model = FILES[name]
    depth = "##" if page == f"{name}.md" else "###"
    length = "length_unit" if "length_unit" in model.model_fields else "m"
    before = [m for n, (p, m) in FILES.items() if p == page and list(FILES).index(n) < list(FILES).index(name)]
    known = {(title, part) for other in before for _, title, _, part in sections(other) if title}
    parts = [s[1:] for s in sections(model)]
    again = [title for title, _, part in parts if (title, part) in known]
    own = [f"{depth} {_section(*s, length)}" for s in parts if s[0] not in again]
    said = f"\n\n{', '.join(f'`{title}`' for title in again)}: as above." if again else ""
    return "\n\n".join(own) + said


def silent(model: Any) -> list[str]:
    """Keys of a settings file that do not say what they are."""
    return [
        f"{prefix}{key}"
        for prefix, _, _, part in sections(model)
        for key in _plain_keys(part)
        if not any(keys_of(part)[key])
    ]


STORED: tuple[tuple[str, type], ...] = (
    ("", ModalBasis), ("/mesh", Mesh), ("S/interfaces/<name>", Interface), ("S", ModalGroup),
    ("S/excitation/<name>", Rows), ("S", Compliance), ("S", StressSet), ("S/contacts/<name>", ContactState),
    ("S/residual", Residual), ("S/run_up", RunUp), ("S/gyroscopic", GyroscopicModes), ("S/invariants", Invariants),
    ("/range/nd_<k>", SpeedRange),
)  # fmt: skip
"""Groups of the modal file and the nouns that stand in them."""


def modal_reference() -> str:
    """Table of what the nouns say of their fields, see `microslip.data.Stored`."""
    rows = [row for group, noun in STORED for row in stored_rows(group, noun)]
    return table(["path", "axes", "unit", "holds"], rows)


def stored_rows(group: str, noun: type) -> list[list[str]]:
    rows = []
    for field, (how, _) in declared(noun).items():
        at, axes = how.at or field, how.over.replace(" ", " x ")
        path = at if at[0] == "/" else group + at if at[0] == "@" else f"{group}/{at}"
        unit = f"`{how.unit}`" if how.unit.startswith("@") else how.unit
        rows.append([f"`{path}`", axes, unit, how.holds + (f"; only if {how.when}" if how.when else "")])
        if how.hertz:
            place = path.removesuffix("omega")
            rows.append([f"`{place}frequency`", axes, "Hz", "omega / (2 pi), never negative"])
    return rows


def sections(model: Any, prefix: str = "", title: str = "") -> Iterator[tuple[str, str, str, Any]]:
    """Prefix of its keys, heading, text and model of each table of a settings file, in order."""
    yield prefix, title, "" if not prefix else " ".join((model.__doc__ or "").split("\n\n")[0].split()), model
    for key, field in _fields(model).items():
        for number, (inner, many) in enumerate(_told(model, field)):
            name = f"{prefix}{key}"
            head = f"[[{name}]]" if many else f"[{name}]"
            kinds = getattr(_fields(inner).get("kind"), "annotation", None)
            if len(_told(model, field)) > 1 and kinds is not None:
                head += " kind = " + " or ".join(f'"{kind}"' for kind in kinds.__args__)
            elif number:
                head += ", or instead"
            yield from sections(inner, f"{name}.", head)


def _fields(model: Any) -> dict[str, Any]:
    """Keys as they are written -> fields, its own before those that it shares with others."""
    named = {field.alias or name: field for name, field in model.model_fields.items()}
    return dict(sorted(named.items(), key=lambda item: item[0] not in model.__annotations__))


def _inner(annotation: Any, many: bool = False) -> list[tuple[Any, bool]]:
    """The settings models inside an annotation (several are alternatives), and whether a list of them is meant."""
    if isinstance(annotation, type) and hasattr(annotation, "model_fields"):
        return [(annotation, many)]
    many = many or getattr(annotation, "__origin__", None) is tuple
    return [found for argument in getattr(annotation, "__args__", ()) for found in _inner(argument, many)]


def _told(model: Any, field: Any) -> list[tuple[Any, bool]]:
    """`_inner`; the tables of a contact file in another one have a page of their own."""
    elsewhere = () if issubclass(model, ContactFile) else (Kind, Temperature)
    return [x for x in _inner(field.annotation) if not issubclass(x[0], elsewhere)]


def _plain_keys(model: Any) -> list[str]:
    return [k for k, f in _fields(model).items() if not _told(model, f)]


def _section(title: str, text: str, model: Any, length: str) -> str:
    schema, said = model.model_json_schema()["properties"], keys_of(model)
    rows = []
    for key in _plain_keys(model):
        unit, meaning = said[key]
        unit, default = unit.replace("length_unit", length), _default(_fields(model)[key])
        rows.append([f"`{key}`", _type(schema[key]), unit, default, meaning])
    return (
        f"{title or 'Top of the file'}\n\n"
        + (f"{text}\n\n" if text else "")
        + table(["key", "value", "unit", "default", "meaning"], rows)
    )


def _default(field: Any) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ("", (), {}):
        return ""
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    if isinstance(value, float) and value >= 1e6:
        return f"{value:g}"
    return f'"{value}"' if isinstance(value, str) else str(value)


WORDS = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}
SIGNS = {
    "minimum": ">=",
    "ge": ">=",
    "exclusiveMinimum": ">",
    "gt": ">",
    "maximum": "<=",
    "le": "<=",
    "exclusiveMaximum": "<",
    "lt": "<",
}
"""Bounds of a JSON schema; of two on one side the later one counts."""


def _type(schema: dict[str, Any]) -> str:
    """What may be written, in words, from a field's JSON schema."""
    if "oneOf" in schema or "$ref" in schema:
        return "table"
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(s) for s in schema["anyOf"] if s.get("type") != "null"))
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{_toml(v)}`" for v in schema.get("enum", [schema.get("const")]))
    kind = schema.get("type")
    if kind == "array":
        count = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        inner = re.sub(r"\b(number|integer)\b", r"\1s", _type(item))
        inner, times = (f"({inner})", f"{count} x") if item.get("type") == "array" else (inner, f"{count}")
        return f"{times if count else 'list of'} {inner}"
    if kind == "object":
        return "table"
    bounds = {sign[0]: f"{sign} {schema[key]:g}" for key, sign in SIGNS.items() if key in schema}
    return " ".join([WORDS.get(str(kind), "any"), ", ".join(bounds.values())]).strip()


# the book ----------------------------------------------------------------------------------------------------------

WALL = {
    "book_figures": "3.2-1", "contact_element": "3.7-7", "contact_stick_slip": "3.7-3", "microslip": "3.8-2",
    "wear": "3.9-2", "phase_portraits": "4.2-1", "sliding_portraits": "4.3-1", "bifurcation": "4.4-1",
    "book_mode": "5.2-5", "blade_response": "5.3-5", "rig_forces": "5.3-7", "spin_pit": "5.4-4",
    "ring_modes": "5.5-1", "ring_orders": "5.5-2", "ring_forces": "5.5-3", "damping_element": "5.5-6",
    "damping_wire": "5.5-8", "multicoupling": "5.5-9", "mistuning_mistuned": "5.6-3", "bolted_pipes": "5.7-2",
    "book_rolling": "6.5-1", "book_heat": "6.7-1", "rolling_creep": "6.6-1", "half_space": "6.7-3",
    "unround_wheels": "6.9-1", "tyre": "6.10-4",
}  # fmt: skip
"""Picture -> one of the figures of the book that it shows."""


def figures_of_the_book() -> list[tuple[str, str, str]]:
    """Printed numbers, what is shown, and what became of it, of the rows of book.md that have figures."""
    rows = []
    for line in (HERE / "book.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and len(cells) == 5 and "Fig" in cells[0]:
            rows.append((re.sub(r"^.*?(Figs?\. )", r"\1", cells[0]), cells[1], cells[4]))
    return rows


def state_of(figure: str) -> tuple[str, str]:
    """The printed numbers of the row that a figure stands in, and its state in one word."""
    for printed, _, state in figures_of_the_book():
        found = re.findall(r"(\d\.\d+)-(\d+)", printed)
        for (section, low), (_, high) in zip(found, [*found[1:], found[-1]], strict=True):
            whole = range(int(low), int(high) + 1) if f"{section}-{low} to" in printed else [int(low)]
            if figure in {f"{section}-{i}" for i in whole}:
                return printed, _mark(state)
    raise LookupError(figure)


def _mark(state: str) -> str:
    words = ("not reproducible", "different", "reproduced")
    word = next(word for word in words if state.removeprefix("parameters ").startswith(word))
    if word == "reproduced":
        word += " in part" * ("different" in state) or " in shape" * ("in shape" in state or "in words" in state)
    return word


def wall() -> str:
    """Pictures, three in a row, each with its figure and what became of it, and linked to its page."""
    cells = []
    for picture, figure in WALL.items():
        page = next(p.name for p in sorted(HERE.glob("*.md")) if p.stem not in ("the_book", "index")
                    and f"pictures/{picture}.png" in p.read_text(encoding="utf-8"))  # fmt: skip
        printed, state = state_of(figure)
        cells.append(f"[![{printed}](pictures/{picture}.png)]({page}) {printed}: **{state}**")
    rows = [cells[i : i + 3] + [""] * (3 - len(cells[i : i + 3])) for i in range(0, len(cells), 3)]
    return table(["", "", ""], rows)


def figure_states() -> str:
    """Table of every row with figures: printed, shown, reproduced, different or not reproducible, and how near."""
    rows = []
    for printed, shown, state in figures_of_the_book():
        rows.append([printed, shown, f"**{_mark(state)}**"])
    return table(["figure", "shown", "state"], rows)


def gallery() -> str:
    """Every picture of these pages as a card that leads to its page; Markdown of sphinx-design."""
    cards, seen = [], set()
    first = ("blade", "cyclic", "squeal", "results", "rolling", "mistuning", "bifurcation", "geometry", "dampers")
    order = {name: i for i, name in enumerate(first)}
    for page in sorted(HERE.glob("*.md"), key=lambda p: (order.get(p.stem, len(first)), p.stem)):
        text = page.read_text(encoding="utf-8")
        for said, picture in re.findall(r"!\[([^\]]*)\]\(pictures/([\w-]+\.png)\)", text):
            if picture not in seen and page.stem not in ("index", "the_book"):
                seen.add(picture)
                card = f":::{{grid-item-card}}\n:img-top: pictures/{picture}\n:link: {page.stem}\n:link-type: doc\n"
                cards.append(f"{card}:class-item: small\n\n{said}\n:::")
    return "::::{grid} 2 3 4 4\n:gutter: 2\n\n" + "\n\n".join(cards) + "\n::::\n"
