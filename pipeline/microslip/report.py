"""One self-contained page about a modal file: `write_report`. Standard library and numpy only.

Every text that comes from a file is escaped; pictures are embedded; nothing is loaded from anywhere.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .basis import check_basis
from .data import ContactState, Interface, ModalBasis, ModalGroup, SpeedRange
from .files.store import write_text
from .linalg.gyroscopic import stability_sentence
from .modes.campbell import crossings, engine_orders, track_basis
from .reduced.compliance import SUPPLIED, Share, sentence, shares, statics_beside
from .reduced.coordinates import basis_in_modes
from .reduced.quality import sentences
from .reduced.truncation import percent, verdict
from .ring.expansion import aliased, certificate_words, certify_ring, ring_checks
from .ring.resonances import (
    HEAD,
    eigenmodes,
    harmonics_of,
    margins,
    resonances,
    speeds_of,
    unanswered,
    waves_of,
    whirl_bounds,
    whirl_sentence,
)
from .ring.resonances import rows as resonance_rows
from .settings.body import GROUND
from .units import Quantity

STYLE = """
:root { color-scheme: light; --ink: #1f242d; --faint: #667; --line: #d9dde5; --tint: #f4f6f9; --accent: #0b4f9c; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 68rem; padding: 1rem; color: var(--ink); background: #fff;
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.8rem; line-height: 1.2; margin: .5rem 0; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .5rem; border-bottom: 2px solid var(--line); padding-bottom: .2rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; }
nav { display: flex; flex-wrap: wrap; gap: .2rem .9rem; margin: .8rem 0; font-size: .9rem; }
a { color: var(--accent); }
.lead { font-size: 1.05rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th { background: var(--tint); vertical-align: bottom; }
th:first-child, td:first-child, .words td, .words th { text-align: left; }
.words td { white-space: normal; overflow-wrap: anywhere; }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; display: block; }
figure.wide img { min-width: 46rem; }
figcaption, .faint { color: var(--faint); font-size: .88rem; }
sup { line-height: 0; }
.row { display: flex; flex-wrap: wrap; gap: 1rem; align-items: flex-start; }
.row figure { flex: 1 1 9rem; max-width: 18rem; margin: 0; }
.box { border-left: 4px solid var(--accent); background: var(--tint); padding: .6rem .9rem; margin: .8rem 0; }
.warn { border-color: #d98410; background: #fdf6ea; }
.bad { border-color: #c8382c; background: #fdf0ee; }
.box p { margin: .25rem 0; }
summary { cursor: pointer; color: var(--accent); margin: .4rem 0; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--tint); padding: .6rem; font-size: .8rem; }
@media print { details > *, details[open] > * { display: block; } nav { display: none; } }
"""

RIGID_ENOUGH = 0.05
"""A patch whose fit residual is below this moves as a rigid patch for most purposes."""


def write_report(
    basis: ModalBasis, pictures: Mapping[str, Path], path: Path | str, remarks: Sequence[str] = (),
    response: Mapping[str, Any] | None = None,
) -> None:  # fmt: skip
    """Write the page, complete or absent.

    Args:
        basis: what it is about. pictures: name -> file, the names of `pictures.draw_all`; others are shown with
            the response. path: of the page. remarks: sentences that a reader must know. response: a summary of
            a case, name -> text, number, list of numbers or list of rows (each a mapping of the same names).

    Raises:
        UserError: no permission, no space.
    """
    write_text(path, report_html(basis, pictures, remarks, response))


def report_html(
    basis: ModalBasis, pictures: Mapping[str, Path], remarks: Sequence[str] = (),
    response: Mapping[str, Any] | None = None,
) -> str:  # fmt: skip
    """The page as text; see `write_report`."""
    stored, basis = basis, basis_in_modes(basis)
    album = _Album(pictures)
    parts = [
        ("Body", _body(basis, album)),
        ("Frequencies", _frequencies(basis, album) if basis.sectors == 1 else _ring_frequencies(basis, album)),
        ("Engine orders", _engine_order_section(basis, album) if basis.sectors > 1 else ""),
        ("Modes", _modes(basis, album)),
        ("Stresses", _stresses(basis, album)),
        ("Interfaces", _interfaces(basis, album)),
        ("Static contact", _contacts(basis, album)),
        ("How many modes are enough", _truncation(stored, basis, album)),
        ("Compliance counted once", _counted_once(stored)),
        ("Loads and read-outs", _rows(basis)),
        ("Friction response", _response(response, album)),
        ("Checks", _checks(basis)),
        ("Provenance", _provenance(basis)),
    ]
    parts = [(title, text) for title, text in parts if text]
    links = "".join(f'<a href="#{_anchor(t)}">{t}</a>' for t, _ in parts)
    sections = "\n".join(f'<section id="{_anchor(t)}"><h2>{t}</h2>\n{text}</section>' for t, text in parts)
    name = html.escape(basis.name)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}: modal basis</title>\n<style>{STYLE}</style></head>\n<body>\n<h1>{name}: modal basis</h1>\n"
        f"{_lead(basis)}{_remarks(remarks)}<nav>{links}</nav>\n{sections}\n</body></html>\n"
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


# --- words and tables ----------------------------------------------------------------------------------------------


def text(value: object) -> str:
    """Escaped; powers of ten of numbers in it are set as such."""
    safe = html.escape(str(value)).replace(" %", "&nbsp;%")
    return re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-])0*(\d+)(?![\w.])", _power, safe)


def _power(found: re.Match[str]) -> str:
    sign = "−" if found[2] == "-" else ""
    return f"{found[1]}·10<sup>{sign}{found[3]}</sup>"


def _number(value: float, digits: int = 4) -> str:
    return text(f"{value:.{digits}g}")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """Cells are HTML already."""
    if not rows:
        return ""
    top = "".join(f"<th>{c}</th>" for c in head)
    body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>\n" for row in rows)
    first = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f'<div class="scroll"><table class="{kind}">{first}<tbody>{body}</tbody></table></div>\n'


def _say(*sentences: str, kind: str = "") -> str:
    shown = "".join(f"<p>{text(s)}</p>" for s in sentences if s)
    return f'<div class="box {kind}">{shown}</div>\n' if kind is not None and kind != "plain" else shown


def _hidden(title: str, inside: str) -> str:
    return f"<details><summary>{text(title)}</summary>\n{inside}</details>\n" if inside else ""


def number_list(numbers: Sequence[int]) -> str:
    """``1 to 4, 7 and 9``."""
    runs: list[list[int]] = []
    for n in sorted(numbers):
        if runs and n == runs[-1][-1] + 1:
            runs[-1].append(n)
        else:
            runs.append([n])
    words = [w for r in runs for w in ([f"{r[0]} to {r[-1]}"] if len(r) > 2 else map(str, r))]
    return ", ".join(words[:-1]) + f" and {words[-1]}" if len(words) > 1 else "".join(words)


class _Album:
    """Pictures by name; each is embedded once, what is left at the end was not asked for."""

    def __init__(self, pictures: Mapping[str, Path]) -> None:
        self.left = dict(pictures)

    def take(self, name: str, caption: str = "", wide: bool = False) -> str:
        """A figure, or nothing if there is no such picture."""
        path = self.left.pop(name, None)
        if path is None or not Path(path).is_file():
            return ""
        data = base64.b64encode(Path(path).read_bytes()).decode()
        kind = "gif" if Path(path).suffix.lower() == ".gif" else "png"
        words = f"<figcaption>{text(caption)}</figcaption>" if caption else ""
        image = f'<img alt="{html.escape(caption or name)}" loading="lazy" src="data:image/{kind};base64,{data}">'
        outer = "wide scroll" if wide else ""
        return f'<figure class="{outer}">{image}{words}</figure>\n'

    def row(self, prefix: str) -> str:
        """All pictures whose names begin so, beside each other."""
        found = [n for n in self.left if n.startswith(prefix)]
        shown = "".join(self.take(n) for n in found)
        return f'<div class="row">{shown}</div>\n' if shown else ""


# --- sections ------------------------------------------------------------------------------------------------------


def _groups(basis: ModalBasis) -> list[ModalGroup]:
    return [basis.groups[k] for k in sorted(basis.groups)]


def _at(group: ModalGroup) -> str:
    return f"{group.speed * 30 / np.pi:.6g} rpm"


def _lead(basis: ModalBasis) -> str:
    group = _groups(basis)[0]
    elastic = group.frequency[group.omega > 0]
    band = f" from {elastic[0]:.5g} Hz to {elastic[-1]:.5g} Hz" if len(elastic) else ""
    rigid = int((group.omega == 0).sum())
    free = f", {rigid} of them rigid" if rigid else ""
    count = len(speeds_of(basis))
    speeds = f" at each of {count} speeds" if count > 1 else ""
    if basis.sectors > 1:
        modes = eigenmodes(group)
        return (
            f'<p class="lead">Ring of {basis.sectors} sectors, {len(harmonics_of(basis))} nodal diameters with '
            f"{modes.n_modes} modes each from {modes.frequency[0]:.5g} Hz{speeds}; mass of a sector "
            f"{_number(basis.mass)} kg. Proved: {text(certificate_words(certify_ring(basis)))}.</p>\n"
        )
    return (
        f'<p class="lead">{group.n_modes} modes{free}{band}{speeds}; mass {_number(basis.mass)} kg. '
        f"{text(certificate(group))}</p>\n"
    )


def certificate(group: ModalGroup) -> str:
    """What the inertia count proves, in one sentence."""
    if not group.checks.get("certified"):
        return "Nothing proves that no mode is missing: the spectrum was not certified (modes.certify)."
    if "upper_shift_hz" not in group.checks:
        return f"These are all {group.n_modes} modes of the system."
    count, limit = (
        int(group.checks.get("count_below_upper_shift", group.n_modes)),
        group.checks.get("upper_shift_hz", 0),
    )
    kept = f"; the first {group.n_modes} are kept" if count > group.n_modes else ""
    return f"The inertia count proves that these are all {count} modes below {limit:.6g} Hz{kept}."


def _remarks(remarks: Sequence[str]) -> str:
    return _say(*remarks, kind="warn") if remarks else ""


def _body(basis: ModalBasis, album: _Album) -> str:
    size = np.ptp(basis.mesh.points, axis=0) * 1e3
    cells = ", ".join(f"{len(c)} {kind}" for kind, c in basis.mesh.cells.items()) or "no cells"
    centre = ", ".join(f"{v * 1e3:.4g}" for v in _clean(basis.centre, float(np.ptp(basis.mesh.points))))
    inertia = _clean(basis.inertia, float(np.abs(basis.inertia).max()))
    rows = [
        ("mass", f"{_number(basis.mass, 6)} kg"),
        *_sectors(basis),
        ("size along x, y, z", text(" × ".join(f"{v:.4g}" for v in size)) + " mm"),
        ("centre of mass x, y, z", text(centre) + " mm"),
        ("inertia about the centre xx, yy, zz", _join(inertia[[0, 1, 2], [0, 1, 2]]) + " kg m²"),
        ("xy, yz, xz", _join(inertia[[0, 1, 0], [1, 2, 2]]) + " kg m²"),
        ("mesh", f"{basis.mesh.n_points} points, {text(cells)}, {3 * basis.mesh.n_points} degrees of freedom"),
        ("held", "rigid motions are left free" if basis.free else "by its supports"),
        ("damping given as", text(basis.damping_source)),
        ("reduction", text(basis.reduction)),
        *_material(basis.provenance),
        *_rotation(basis),
    ]
    return (
        _table([], [(text(a), b) for a, b in rows], "words")
        + album.take("mesh", "The mesh and its named faces, seen from two opposite sides.")
    )  # fmt: skip


def _sectors(basis: ModalBasis) -> list[tuple[str, str]]:
    if basis.sectors == 1:
        return []
    held = number_list(harmonics_of(basis))
    words = f"one of {basis.sectors} alike round the axis; all numbers here are of one; nodal diameters {held}"
    return [("sector", text(words))]


def _clean(values: Any, scale: float) -> Any:
    """Rounding rests set to zero."""
    return np.where(np.abs(values) < 1e-9 * scale, 0.0, values)


def _join(values: Any) -> str:
    return ", ".join(_number(float(v)) for v in values)


def _material(provenance: Mapping[str, str]) -> list[tuple[str, str]]:
    """The material's row, if the settings travel with the file."""
    try:
        found = json.loads(provenance.get("settings", "{}")).get("material", {})
        words = [str(found.get("name", "material"))]
        words += [f"density {found['density']} kg/m³"] if "density" in found else []
        words += [f"E = {_pascal(found['young'])}"] if "young" in found else []
        words += [f"nu = {found['poisson']}"] if "poisson" in found else []
    except (ValueError, AttributeError, TypeError):
        words = []
    if len(words) < 2:
        return [("material", text(provenance["material"]))] if provenance.get("material") else []
    return [("material", text(", ".join(words)))]


def _pascal(value: Any) -> str:
    return ", ".join(f"{float(v) / 1e9:g}" for v in (value if isinstance(value, list) else [value])) + " GPa"


def _rotation(basis: ModalBasis) -> list[tuple[str, str]]:
    groups = _groups(basis)
    if not any(g.speed for g in groups):
        return []
    axis = ", ".join(f"{v:.4g}" for v in basis.rotation_axis)
    point = ", ".join(f"{v * 1e3:.4g}" for v in basis.rotation_point)
    stress = {"nonlinear": "nonlinear equilibrium", "linear": "linear prestress", "none": "no prestress"}
    how = stress.get(groups[-1].prestress, groups[-1].prestress)
    softening = "with" if groups[-1].spin_softening else "without"
    return [("rotation", text(f"about ({axis}) through ({point}) mm; {how}, {softening} spin softening"))]


def _frequencies(basis: ModalBasis, album: _Album) -> str:
    groups = _groups(basis)
    several = len(groups) > 1
    head = ["mode"] + [f"Hz at {_at(g)}" if several else "Hz" for g in groups] + ["damping in %", "kind"]
    rows = []
    for j in range(max(g.n_modes for g in groups)):
        cells = [
            f"{g.frequency[j]:#.6g}" if j < g.n_modes and g.omega[j] else "0" if j < g.n_modes else "" for g in groups
        ]
        first = next(g for g in groups if j < g.n_modes)
        rows.append([str(j + 1), *cells, f"{100 * first.damping_ratio[j]:.4g}", text(first.kind[j])])
    proofs = [(f"{_at(g)}: " if several else "") + certificate(g) for g in groups]
    out = _say(*proofs, kind="" if all(g.checks.get("certified") for g in groups) else "warn")
    words = [f"{w[:1].upper()}{w[1:]}." for w in sentences(groups[0], basis.reduction)]
    quality = _say(*words, kind="plain") if words else ""
    return out + _table(head, rows) + quality + _campbell(basis, album) + _gyroscopic(groups)


def _gyroscopic(groups: Sequence[ModalGroup]) -> str:
    """Frequencies with gyroscopic coupling at every speed, and whether the body is stable."""
    out = ""
    for g in groups:
        if (y := g.gyroscopic) is None:
            continue
        bounds = [f"{100 * e:.2g} %" if np.isfinite(e) else "" for e in y.error]
        rows = [
            [str(i + 1), f"{f:#.6g}", text(way), f"{s:+.2f}", text(bound)]
            for i, (f, way, s, bound) in enumerate(zip(y.frequency, y.direction, y.sense, bounds, strict=True))
        ]
        head = ["mode", "Hz", "direction", "sense of the orbits", "too high by at most"]
        out += _say(f"{_at(g)}: {stability_sentence(y)}", kind="plain" if y.stable else "bad")
        out += _hidden(f"Modes with gyroscopic coupling at {_at(g)}, in the rotating frame", _table(head, rows))
    return out


def _campbell(basis: ModalBasis, album: _Album) -> str:
    tracks = track_basis(basis)
    if tracks is None:
        return ""
    out = _say(
        "Modes are ordered by frequency at each speed; the Campbell diagram joins those that have the same shape. "
        "The frequencies hold stress stiffening and spin softening as stated above, but no gyroscopic coupling, which "
        "stands beside.",
        kind="plain",
    )
    out += _say(*(range_sentence(k, r) for k, r in sorted(basis.ranges.items())), kind="plain")
    out += album.take("campbell", "Campbell diagram.")
    rows = [
        [str(c.order), str(int(tracks.modes[c.curve][tracks.modes[c.curve] >= 0][0]) + 1)]
        + [f"{c.speed * 30 / np.pi:.0f}", f"{c.frequency:.5g}"]
        for c in crossings(tracks, engine_orders(basis))
    ]
    return out + _hidden("Where engine orders meet modes", _table(["engine order", "mode", "rpm", "Hz"], rows))


def range_sentence(harmonic: int, r: SpeedRange) -> str:
    """How a speed range was made and how good it is."""
    low, high = r.speeds[[0, -1]] * 30 / np.pi
    held = " and ".join(f"{v:.0f}" for v in r.held_out * 30 / np.pi)
    which = f"Nodal diameter {harmonic}: between" if harmonic else "Between"
    return (
        f"{which} {low:.6g} and {high:.6g} rpm one basis of {r.samples[0].n_modes} coordinates serves at every speed: "
        f"modes from {int(r.solved.sum())} speeds, stiffness from {int((~r.held).sum())}; at {held} rpm, "
        f"which were held out, its frequencies err by {r.total_error.max():.1e} at most."
    )


def _ring_frequencies(basis: ModalBasis, album: _Album) -> str:
    """Frequencies over the nodal diameters, and what the sector proves of the ring."""
    speeds, held = speeds_of(basis), harmonics_of(basis)
    proofs = [certify_ring(basis, s) for s in speeds]
    out = ""
    for s, proof in zip(speeds, proofs, strict=True):
        where = f"{_at(basis.groups[s, held[0]])}: " if len(speeds) > 1 else ""
        out += _say(f"{where}{certificate_words(proof)}.", kind="" if proof.certified else "warn")
    out += _say(
        "Sector j moves as the sector itself times exp(i j k 2 pi / N), k the nodal diameter. A frequency at 0 < k < "
        "N/2 belongs to two modes of the ring, waves that run forward and backward; no gyroscopic coupling is in it. "
        "Where the file has the coupling, frequencies with it stand in a table of their own.",
        kind="plain",
    )
    out += album.take("nodal_diameters", "Frequency over nodal diameter; each line is a family of modes.")
    out += album.take("nodal_diameters_stuck", "Neighbours as in the modes, and stuck to each other without slip.")
    out += _say(*(range_sentence(k, r) for k, r in sorted(basis.ranges.items())), kind="plain")
    for i, s in enumerate(speeds):
        shown = _ring_table([eigenmodes(basis.groups[s, k]) for k in held])
        out += shown if i == 0 else _hidden(f"Frequencies at {_at(basis.groups[s, held[0]])}", shown)
        out += _ring_whirl([basis.groups[s, k] for k in held])
    return out


def _ring_whirl(groups: Sequence[ModalGroup]) -> str:
    """Backward and forward waves of every nodal diameter with gyroscopic coupling, if a speed's groups hold it."""
    if (words := whirl_sentence(groups)) is None:
        return ""
    waves = [(f"k = {g.harmonic}<br>{way}", f) for g in groups for way, (f, _) in waves_of(g).items()]
    bounds = [f"{100 * b:.2g}&nbsp;%" if np.isfinite(b) else "" for b in whirl_bounds(groups)]
    rows = [
        [str(j + 1), *(f"{f[j]:#.6g}" if j < len(f) else "" for _, f in waves), bound] for j, bound in enumerate(bounds)
    ]
    table = _table([f"Hz at {_at(groups[0])}, mode", *(head for head, _ in waves), "too high by at most"], rows)
    stable = all(g.gyroscopic is None or g.gyroscopic.stable for g in groups)
    title = f"Waves with gyroscopic coupling at {_at(groups[0])}, in the rotating frame"
    return _say(f"{_at(groups[0])}: {words}", kind="plain" if stable else "bad") + _hidden(title, table)


def _ring_table(groups: Sequence[ModalGroup]) -> str:
    head = [f"Hz at {_at(groups[0])}, mode", *(f"k = {g.harmonic}" for g in groups)]
    rows = [
        [str(j + 1), *(f"{g.frequency[j]:#.6g}" if j < g.n_modes else "" for g in groups)]
        for j in range(max(g.n_modes for g in groups))
    ]
    return _table(head, rows)


def _engine_order_section(basis: ModalBasis, album: _Album) -> str:
    """Which engine order really excites which mode."""
    orders = engine_orders(basis)
    out = _say(
        "An engine order e excites a mode only if both its frequency and its nodal diameter fit: N sectors feel e as "
        "the nodal diameter k = e mod N, or N - e mod N if that is smaller. Resonances and distances hold gyroscopic "
        "coupling, which splits forward and backward waves, where the file has it.",
        kind="plain",
    )
    pairs = [(e, *aliased(e, basis.sectors)) for e in orders if e > 0]
    out += _table(["engine order", "nodal diameter", "wave on the rotor"], [[str(v) for v in row] for row in pairs])
    if lacking := unanswered(basis, orders):
        out += _say(f"The file lacks the nodal diameters of the engine orders {number_list(lacking)}.", kind="warn")
    out += album.take("safe", "Interference diagram (SAFE, ZZENF): a resonance is where a diamond lies on a dot.")
    out += album.take("campbell", "Campbell diagram; circles are true resonances.")
    several = bool(basis.ranges) or len(speeds_of(basis)) > 1
    found = resonances(basis, orders) if several else []
    if found:
        out += "<h3>True resonances</h3>\n" + _table(HEAD, [[text(c) for c in row] for row in resonance_rows(found)])
    elif pairs and several:
        out += _say("No engine order meets a mode of its nodal diameter between the lowest and the highest speed.")
    return out + _nearest(basis, orders)


def _nearest(basis: ModalBasis, orders: Sequence[int]) -> str:
    """The modes nearest to the engine orders at the highest speed."""
    fastest = speeds_of(basis)[-1]
    rows = [
        [str(m.order), str(m.nodal_diameter), m.direction, str(m.family or ""), f"{m.frequency:.5g}"]
        + [f"{m.excitation:.5g}", f"{100 * m.relative:+.1f}&nbsp;%"]
        for m in margins(basis, fastest, orders)[:12]
    ]
    head = ["engine order", "nodal diameter", "wave", "family", "mode in Hz", "excitation in Hz", "mode above it"]
    speed = _at(basis.groups[fastest, harmonics_of(basis)[0]])
    return _hidden(f"The modes nearest to an engine order at {speed}", _table(head, rows)) if rows else ""


def _modes(basis: ModalBasis, album: _Album) -> str:
    moving = album.row("ring_wave_") + album.row("animation_")
    rings = "".join(album.take(n, wide=True) for n in [n for n in album.left if n.startswith("ring_modes_")])
    sheets = "".join(album.take(n, wide=True) for n in [n for n in album.left if n.startswith("modes_")])
    single = ""
    for group in _groups(basis):
        rpm = f"{group.speed * 30 / np.pi:.6g}rpm"
        names = [n for n in album.left if n.startswith("mode_") and n.endswith(f"_{rpm}")]
        if names:
            shown = "".join(album.take(n) for n in names)
            of = f" of nodal diameter {group.harmonic}" if basis.sectors > 1 else ""
            single += _hidden(f"Each mode{of} at {_at(group)}", f'<div class="row">{shown}</div>')
    return rings + moving + sheets + single


def _stresses(basis: ModalBasis, album: _Album) -> str:
    return album.take("stress_modes", wide=True) + album.take("static")


def _interfaces(basis: ModalBasis, album: _Album) -> str:
    group = _groups(basis)[0]
    if not group.interfaces:
        return ""
    rows = []
    for name, i in group.interfaces.items():
        origin = ", ".join(f"{v * 1e3:.4g}" for v in _clean(i.origin, float(np.abs(basis.mesh.points).max())))
        normal = ", ".join(f"{v:.3g}" for v in _clean(i.rotation[0], 1.0))
        role = i.role + (f", faces {i.partner}" if i.partner else "")
        area = f"{1e6 * i.areas.sum():.4g}"
        rows.append([text(name), text(role), area, str(len(i.areas)), text(origin), text(normal)])
    head = ["interface", "role", "area in mm²", "points", "origin in mm", "outward normal"]
    contacts = {name: i for name, i in group.interfaces.items() if i.role != "load"}
    words = [fit_sentence(name, i, group) for name, i in contacts.items()]
    rigid = _say(*words, kind="plain")
    if len(words) > 4:
        rigid = _say(_fit_summary(contacts), kind="plain") + _hidden("Each patch", rigid)
    return (
        _table(head, rows)
        + album.take("interfaces", "Where the patches lie, their points, and their frames n, t1, t2.")
        + ("<h3>Do the patches move as rigid ones?</h3>\n" + rigid if words else "")
    )  # fmt: skip


def _contacts(basis: ModalBasis, album: _Album) -> str:
    """Closures over the speeds; the nodal diameters share one static state."""
    states = {g.speed: g for g in reversed(_groups(basis))}
    rows, words = [], []
    for group in (states[speed] for speed in sorted(states)):
        words += [f"{_at(group)}: {contact_sentence(name, c)}" for name, c in group.contacts.items()]
        for name, c in group.contacts.items():
            middle = ", ".join(f"{v * 1e3:.4g}" for v in _clean(c.centre, float(np.abs(basis.mesh.points).max())))
            rows.append([
                text(name), text(_at(group)), _number(c.normal_force), _number(1e-6 * c.pressure.max(initial=0.0)),
                text(percent(c.closed_share)), text(middle), _number(1e6 * c.gap.min(initial=0.0)),
                _number(1e6 * c.gap.max(initial=0.0)),
            ])  # fmt: skip
    if not rows:
        return ""
    head = ["contact", "speed", "normal force in N", "highest pressure in MPa", "area in contact", "centre in mm"]
    return (
        _table([*head, "least gap in µm", "widest gap in µm"], rows)
        + album.take("closure", "Pressure on the faces that touch in the static state.")
        + _hidden("In words", _say(*words, kind="plain"))
    )


def contact_sentence(name: str, c: ContactState) -> str:
    """What a closure does in the static state, in words."""
    other = "the ground" if c.against == GROUND else c.against + (" of the neighbour" if c.sector_shift else "")
    if not c.normal_force:
        return f"contact {name}: {c.face} is open against {other}, the gap {1e6 * c.gap.min():.4g} µm or wider."
    kept = "the modes leave it open" if c.modes == "open" else "the modes keep it closed"
    return (
        f"contact {name}: {c.face} presses {other} with {c.normal_force:.5g} N on {percent(c.closed_share)} of its "
        f"area, at most {1e-6 * c.pressure.max():.4g} MPa (penetration left {1e6 * c.penetration:.2g} µm); {kept}."
    )


def _fit_summary(contacts: Mapping[str, Interface]) -> str:
    """One sentence over all patches."""
    worst = {name: float(i.fit_residual.max()) for name, i in contacts.items()}
    loose = [name for name, value in worst.items() if value > RIGID_ENOUGH]
    if not loose:
        return f"All {len(worst)} patches move as rigid ones (to {100 * RIGID_ENOUGH:g} %) in all modes."
    name = max(loose, key=lambda n: worst[n])
    mode = int(contacts[name].fit_residual.argmax()) + 1
    return (
        f"Of {len(worst)} patches {len(loose)} deform in some modes, most of all {name} in mode {mode}: "
        f"{percent(worst[name])} of its motion is not rigid."
    )


def fit_sentence(name: str, interface: Interface, group: ModalGroup) -> str:
    """How well six components describe the motion of a patch, in words."""
    residual = interface.fit_residual
    loose = [j for j in range(group.n_modes) if residual[j] > RIGID_ENOUGH]
    firm = [j + 1 for j in range(group.n_modes) if j not in loose]
    limit = f"{100 * RIGID_ENOUGH:g} %"
    if not loose:
        most = percent(float(residual.max()))
        return f"{name} moves as a rigid patch in all modes (at most {most} of its motion is deformation)."
    worst = max(loose, key=lambda j: residual[j])
    begins = f"{name} moves as a rigid patch (to {limit}) in modes {number_list(firm)}; it" if firm else name
    return (
        f"{begins} deforms in modes {number_list([j + 1 for j in loose])} (most in mode {worst + 1}: "
        f"{percent(float(residual[worst]))} of its motion is not rigid), which six components do not see."
    )


def _truncation(stored: ModalBasis, basis: ModalBasis, album: _Album) -> str:
    group = _groups(basis)[0]
    found = verdict(group, statics_beside(_groups(stored)[0], basis.reduction), basis.sectors)
    if not found.coordinates:
        return _say(found.sentence)
    rows = [
        [text(c.label), f"{_number(c.static)} {c.unit}", percent(c.share), f"{_number(c.residual)} {c.unit}"]
        + [str(c.modes_for(s) or "more") for s in (0.9, 0.99)]
        for c in found.coordinates
    ]
    head = ["coordinate", "static compliance", "held by the modes", "left out", "modes for 90 %", "modes for 99 %"]
    relief = "The body can move as a rigid one: compliance is that of its elastic part (inertia relief)."
    return (
        _say(found.sentence)
        + _say(*found.remarks, relief if group.compliance.inertia_relief else "", kind="plain")
        + _hidden("Every coordinate", _table(head, rows))
        + album.take("compliance", "Share of the static compliance over the number of modes kept.")
    )


def _counted_once(basis: ModalBasis) -> str:
    """Per interface coordinate: what the basis holds, what is left to a contact law, what must not be in it."""
    group = _groups(basis)[0]
    found = shares(group, basis.reduction, basis.sectors)
    if not found:
        return ""
    solver = basis.reduction in SUPPLIED
    head = ["coordinate", "unit", "static", "basis holds", *(["solver adds"] if solver else [])]
    head += ["left to the law", "as a spring", "not in the law"]
    pairs = [s for s in found if s.kind == "squeeze"]
    words = "Left to the law: bulk that it must bring besides the surface. Not in the law: bulk that plain eigenmodes "
    words += "would leave to it and this basis holds already, so that a stiffness like E A / l0 would count it twice. "
    words += 'Say in case.toml which one a stiffness is: includes = "bulk+surface" or "surface".'
    table = _table(head, [_share_row(s, solver) for s in found])
    return (
        _say(sentence(basis, group))
        + (_table(head, [_share_row(s, solver) for s in pairs]) if pairs else "")
        + _say(words, kind="plain")
        + _hidden("Each interface coordinate", table)
    )


def _share_row(s: Share, solver: bool) -> list[str]:
    def amount(value: float) -> str:
        return _number(value) if value else "nothing"

    spring = "N m/rad" if s.kind == "rotation" else "N/m"
    row = [text(s.label), text(s.unit), amount(s.static), amount(s.held)] + ([amount(s.supplied)] if solver else [])
    return [*row, amount(s.left), f"{_number(s.law_stiffness)} {spring}" if s.left else "", amount(s.beyond)]


def _rows(basis: ModalBasis) -> str:
    group = _groups(basis)[0]
    out = []
    for kind, named in (("excitation", group.excitations), ("monitor", group.monitors), ("gauge", group.gauges)):
        for name, rows in named.items():
            at = ", ".join(f"{v * 1e3:.4g}" for v in _clean(rows.point, float(np.abs(basis.mesh.points).max())))
            off = f"{rows.distance * 1e3:.3g}" if rows.distance > 1e-9 else "0"
            out.append([kind, text(name), text(" ".join(rows.labels)), text(rows.unit), text(at), off])
    return _table(["kind", "name", "rows", "unit", "at, in mm", "mm off the body"], out)


SHOWN = {
    "friction response": "Amplitude over frequency for every normal force.",
    "stress over frequency": "Largest stress amplitude of the body: von Mises stress of the alternating part.",
    "stress over normal force": "Stress at every resonance; a ring marks a lowest one between the ends.",
    "stress at resonance": "The resonance with the least margin, or the most stressed one where no limits are given.",
    "Haigh diagram": "Amplitude over mean stress of every place, and what the material endures.",
    "contacts at resonance": "What the points of the contacts do in a cycle there, as the case's mode computed it.",
}
"""Pictures of a response in their order, and what they show."""


def response_page(summary: Mapping[str, Any], pictures: Mapping[str, Path], path: Path | str) -> None:
    """Write a self-contained page of a case alone, complete or absent.

    Args:
        summary: see `write_report`; its remarks stand on top. pictures: name -> file. path: of the page.

    Raises:
        UserError: no permission, no space.
    """
    name = html.escape(str(summary.get("case", "case")))
    told = {k: v for k, v in summary.items() if k not in ("remarks", "pictures")}
    body = f"<h1>{name}: friction response</h1>\n{_remarks(list(summary.get('remarks', [])))}"
    body += _response(told, _Album(pictures))
    write_text(path, _page(f"{name}: friction response", body))


def _page(title: str, body: str) -> str:
    """A page of HTML. title: HTML already."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


MOST_ROWS = 60
"""Rows of a table that a page shows at once; the others unfold."""


def survey_page(
    title: str, sentences: Sequence[str], tables: Mapping[str, Mapping[str, Any]], pictures: Sequence[Path],
    path: Path | str,
) -> None:  # fmt: skip
    """Write a self-contained page of a survey, complete or absent: what was found in words, pictures and tables.

    Args:
        tables: file name -> (column -> values).

    Raises:
        UserError: no permission, no space.
    """
    album = _Album({p.name: p for p in pictures})
    body = f"<h1>{text(title)}</h1>\n{_say(*sentences)}" if sentences else f"<h1>{text(title)}</h1>\n"
    body += "".join(album.take(p.name) for p in pictures)
    for name, columns in tables.items():
        head = [text(_label(key)) for key in columns]
        rows = [[_number(float(v), 5) for v in row] for row in zip(*columns.values(), strict=True)]
        shown = _table(head, rows)
        body += f"<h2>{text(name)}</h2>\n"
        body += shown if len(rows) <= MOST_ROWS else _hidden(f"{len(rows)} rows", shown)
    write_text(path, _page(text(title), body))


def _response(response: Mapping[str, Any] | None, album: _Album) -> str:
    """What the case tells, its tables, and every picture that no other section took."""
    tables, facts, words = "", list[tuple[str, str]](), ""
    for key, value in (response or {}).items():
        if key.endswith("sha256"):
            continue
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            tables += _rows_of(key, value)
        elif isinstance(value, list):
            facts.append((text(_label(key)), ", ".join(_cell(v) for v in value)))
        elif key == "description" and value:
            words = _say(f"{value}.", kind="plain")
        elif value not in ("", None):
            facts.append((text(_label(key)), _cell(value)))
    shown = "".join(album.take(name, caption) for name, caption in SHOWN.items())
    for name in list(album.left):
        if not name.startswith(("mode_", "modes_", "animation_")):
            shown += album.take(name, name)
    failed = (response or {}).get("failed_points")
    warning = _say(f"{failed} points did not converge; they are marked in the table.", kind="bad") if failed else ""
    return words + warning + tables + shown + _table([], facts, "words")


def _rows_of(key: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """A table of rows that have the same names; lengths and stresses in units for people."""
    factors = {k: next((f for end, f in _FACTORS if k.endswith(end)), (1.0, k)) for k in rows[0]}
    head = [
        text(_label(k.removesuffix(k.rsplit("_", 1)[-1]) + unit if f != 1.0 else k)) for k, (f, unit) in factors.items()
    ]
    body = [
        [_cell(v * f if f != 1.0 else v) for v, (f, _) in zip(row.values(), factors.values(), strict=True)]
        for row in rows
    ]
    return f"<h3>{text(_label(key))}</h3>\n" + _table(head, body)


_FACTORS = (
    *((Quantity(unit).column("amplitude"), (1e6, Quantity(unit).micro)) for unit in ("m", "rad", "1")),
    ("_Pa", (1e-6, "MPa")),
)
"""Ends of names of numbers that are shown in another unit."""


_UNITS = ("N", "Hz", "m", "mm", "µm", "m/m", "µm/m", "rad", "µrad", "s", "Pa", "MPa", "rpm", "W", "J", "K")


def _label(key: str) -> str:
    """``normal_force_N`` -> ``normal force in N``."""
    words = key.split("_")
    words = [*words[:-1], "m/m"] if words[-1] == "strain" and len(words) > 1 else words
    if len(words) > 1 and words[-1] in _UNITS:
        return " ".join(words[:-1]) + f" in {words[-1]}"
    return " ".join(words)


def _cell(value: Any) -> str:
    return _number(value, 5) if isinstance(value, float) else text(value)


def _checks(basis: ModalBasis) -> str:
    found = [*check_basis(basis), *ring_checks(basis)]
    failed = [c for c in found if not c.passed]
    rows = [
        [
            text(c.name),
            _number(c.value, 3),
            _number(c.limit, 3),
            "passed" if c.passed else "<b>failed</b>",
            text(c.remark),
        ]
        for c in found
    ]
    table = _table(["check", "value", "limit", "", "remark"], rows)
    if failed:
        names = "; ".join(c.name for c in failed)
        return _say(f"{len(failed)} of {len(found)} checks failed: {names}.", kind="bad") + table
    return _say(f"All {len(found)} checks of the file passed.") + _hidden("Every check", table)


def _provenance(basis: ModalBasis) -> str:
    short = [(text(k), text(v)) for k, v in sorted(basis.provenance.items()) if len(v) <= 80 and v]
    long = [(k, v) for k, v in sorted(basis.provenance.items()) if len(v) > 80]
    return _table([], short, "words") + "".join(_hidden(k, f"<pre>{html.escape(v)}</pre>") for k, v in long)
