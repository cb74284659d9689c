"""What the page of a cyclic sector says besides: nodal diameters, engine orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import ModalBasis, ModalGroup
from ..modal.campbell import engine_orders
from ..ring import resonances
from ..ring.expansion import aliased, certificate_words, certify_ring
from ..units import counted, rpm_text
from .page import Album, Piece, fold, say, table
from .words import hertz, number_list, range_sentence


def frequencies(basis: ModalBasis, album: Album) -> list[Piece]:
    """Frequencies over the nodal diameters, and what the sector proves of the ring."""
    held = resonances.harmonics_of(basis)
    speeds = {s: rpm_text(basis.groups[s, held[0]].speed) for s in resonances.speeds_of(basis)}
    told: dict[bool, list[str]] = {}
    for s, at in speeds.items():
        proof = certify_ring(basis, s)
        where = f"{at}: " if len(speeds) > 1 else ""
        told.setdefault(proof.certified, []).append(f"{where}{certificate_words(proof)}.")
    out = [
        *(say(*words, tone="note" if certified else "warn") for certified, words in sorted(told.items())),
        Piece("paragraph", "waves"),
        album.take("nodal_diameters"),
        album.take("nodal_diameters_stuck"),
        say(*(range_sentence(k, r) for k, r in sorted(basis.ranges.items()))),
    ]
    for i, (s, at) in enumerate(speeds.items()):
        groups = [basis.groups[s, k] for k in held]
        modes = [resonances.eigenmodes(g) for g in groups]
        rows = [[j + 1, *(hertz(g.frequency, j, 5) for g in modes)] for j in range(max(g.n_modes for g in modes))]
        shown, title = table(["mode", *(f"k = {k}" for k in held)], rows), f"Frequencies in Hz at {at}"
        out += [*([fold(title, shown)] if i else [Piece("h3", title), shown]), *whirl(groups)]
    return out


def whirl(groups: Sequence[ModalGroup]) -> list[Piece]:
    """Backward and forward waves of every nodal diameter with gyroscopic coupling, if a speed's groups hold it."""
    if (words := resonances.whirl_sentence(groups)) is None:
        return []
    at = rpm_text(groups[0].speed)
    waves = {f"k = {g.harmonic}\n{way}": f for g in groups for way, (f, _) in resonances.waves_of(g).items()}
    bounds = [f"{100 * b:.2g} %" if np.isfinite(b) else "" for b in resonances.whirl_bounds(groups)]
    rows = [[j + 1, *(hertz(f, j) for f in waves.values()), bound] for j, bound in enumerate(bounds)]
    stable = all(g.gyroscopic is None or g.gyroscopic.stable for g in groups)
    shown = table([f"Hz at {at}, mode", *waves, "too high by at most"], rows)
    return [
        say(f"{at}: {words}", tone="" if stable else "bad"),
        fold(f"Waves with gyroscopic coupling at {at}, in the rotating frame", shown),
    ]


def orders(basis: ModalBasis, album: Album) -> list[Piece]:
    """Which engine order really excites which mode."""
    asked = engine_orders(basis)
    pairs = [(e, *aliased(e, basis.sectors)) for e in asked if e > 0]
    lacking = number_list(resonances.unanswered(basis, asked))
    several = bool(basis.ranges) or len(resonances.speeds_of(basis)) > 1
    found = resonances.resonances(basis, asked) if several else []
    none = "No engine order meets a mode of its nodal diameter between the lowest and the highest speed."
    meets = f"{counted(len(found), 'true resonance')} between the lowest and the highest speed."
    return [
        say(meets if found else none if pairs and several else ""),
        album.take("campbell", "Campbell diagram; circles are true resonances."),
        table(resonances.HEAD, resonances.rows(found)),
        album.take("safe"),
        Piece("paragraph", "engine orders"),
        table(["engine order", "nodal diameter", "wave on the rotor"], pairs),
        say(f"The file lacks the nodal diameters of the engine orders {lacking}." if lacking else "", tone="warn"),
        _nearest(basis, asked),
    ]


def _nearest(basis: ModalBasis, asked: Sequence[int]) -> Piece:
    """The modes nearest to the engine orders at the highest speed."""
    fastest = resonances.speeds_of(basis)[-1]
    rows = [
        [m.order, m.nodal_diameter, m.direction, m.family or "", f"{m.frequency:.5g}", f"{m.excitation:.5g}"]
        + [f"{100 * m.relative:+.1f} %"]
        for m in resonances.margins(basis, fastest, asked)[:12]
    ]
    head = ["engine order", "nodal diameter", "wave", "family", "mode in Hz", "excitation in Hz", "mode above it"]
    at = rpm_text(basis.groups[fastest, resonances.harmonics_of(basis)[0]].speed)
    return fold(f"The modes nearest to an engine order at {at}", table(head, rows))
