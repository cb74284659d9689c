"""What a modal file holds, in lines for the terminal."""

from __future__ import annotations

import numpy as np

from ..data import Array, GyroscopicModes, ModalBasis, ModalGroup, SpeedRange
from ..linalg.gyroscopic import stability_sentence
from ..operating.stress import READS_THE_MESH, in_singular_zone
from ..reduced.compliance import sentence
from ..reduced.coordinates import certified_modes, own_kind
from ..reduced.quality import sentences
from ..report.words import contact_sentence, counted_modes, proof
from ..ring.expansion import certificate_words, certify_ring
from ..ring.resonances import (
    eigenmodes,
    harmonics_of,
    speeds_of,
    waves_of,
    whirl_bounds,
    whirl_sentence,
)
from ..units import to_rpm


def whirl_rows(modes: GyroscopicModes) -> list[str]:
    """A line for each mode with gyroscopic coupling."""
    out = []
    for f, way, sense, growth, error in zip(
        modes.frequency, modes.direction, modes.sense, modes.growth, modes.error, strict=True
    ):
        sure = "" if np.isnan(error) else f"   within {100 * error:.2g} %"
        out.append(f"{f:14.6g} Hz   {way} ({sense:+.2f}){sure}" + (f"   GROWS {growth:.3g} 1/s" if growth else ""))
    return out


def basis_summary(basis: ModalBasis) -> list[str]:
    """What a modal file holds, in lines for the terminal."""
    extent = np.ptp(basis.mesh.points, axis=0) * 1e3 if basis.mesh.n_points else np.zeros(3)
    lines = [
        f"{basis.name}: {basis.mesh.n_points} points, {basis.mesh.n_cells} cells, mass {basis.mass:.6g} kg, "
        f"{extent[0]:.4g} x {extent[1]:.4g} x {extent[2]:.4g} mm, reduction {basis.reduction}",
    ]
    ranges = [line for k, r in sorted(basis.ranges.items()) for line in range_summary(k, r)]
    if basis.sectors > 1:
        return lines + _ring_summary(basis) + ranges
    for (_, harmonic), g in sorted(basis.groups.items()):
        state = f"{to_rpm(g.speed):g} rpm" + (f", {g.prestress} prestress" if g.prestress != "none" else "")
        modes = counted_modes(g)
        known = f"{modes}, {between}" if (between := between_stations([g])) else proof(g)
        if basis.source == "measured":
            known = f"{modes}, measured: others may have been missed"
        lines.append(f"{state}, nodal diameter {harmonic}: {known}")
        if g.N_r is not None:
            lines.append("  circulatory forces stand beside as N_r: microslip stability tells what they do")
        lines += contact_lines(g)
        lines += [f"  {text}" for text in sentences(g, basis.reduction)]
        singular = [name for name, gauge in g.gauges.items() if in_singular_zone(g, gauge.point)]
        lines += [f"  gauge '{name}' {READS_THE_MESH}" for name in singular]
        lines += [
            f"  {i + 1:4d}  {f:14.6g} Hz   D = {d:.4g}   {k}"
            for i, (f, d, k) in enumerate(zip(g.frequency, g.damping_ratio, own_kind(g), strict=True))
        ]
        if g.gyroscopic is not None:
            lines.append(f"  with gyroscopic coupling, in the rotating frame. {stability_sentence(g.gyroscopic)}")
            lines += [f"  {i + 1:4d}  {row}" for i, row in enumerate(whirl_rows(g.gyroscopic))]
    if any(group.interfaces for group in basis.groups.values()):
        lines.append(f"compliance: {sentence(basis, basis.groups[min(basis.groups)])}")
    return lines + ranges


def between_stations(groups: list[ModalGroup]) -> str:
    """What stands for a certificate at a speed of a range that was not solved for; empty where it was."""
    errors = [g.checks["held_out_error"] for g in groups if "held_out_error" in g.checks]
    if not errors:
        return ""
    return (
        f"from the basis of the speed range; at the speeds held out its frequencies err by {max(errors):.1e} at most "
        "and the inertia count finds no further mode"
    )


def contact_lines(group: ModalGroup) -> list[str]:
    """What each closure does, and how well that is known at a speed inside a range."""
    lines = [f"  {contact_sentence(name, c)}" for name, c in group.contacts.items()]
    if lines and "held_out_error" in group.checks:
        error = group.checks.get("normal_force_error", float("nan"))
        sure = f"to about {error:.3g} N" if np.isfinite(error) else "how well is not known"
        lines.append(f"    (between the equilibria of the range, along straight lines in the speed squared; {sure})")
    return lines


def range_summary(harmonic: int, r: SpeedRange) -> list[str]:
    """Samples and held-out errors of a speed range, in lines for the terminal."""
    solved, known, rpm = (
        ", ".join(f"{v:.6g}" for v in to_rpm(speeds))
        for speeds in (r.speeds[r.solved], r.speeds[~r.held], r.speeds[[0, -1]])
    )
    lines = [
        f"{rpm.replace(', ', ' to ')} rpm, nodal diameter {harmonic}: one basis of {r.samples[0].n_modes} coordinates "
        f"for {r.count} modes",
        f"  modes taken from {solved} rpm, stiffness from {known} rpm",
    ]
    held = zip(to_rpm(r.held_out), r.interpolation_error, r.projection_error, r.total_error, strict=True)
    lines += [
        f"  held out {v:.6g} rpm: frequency error {total:.1e} (interpolation {a:.1e}, projection {b:.1e})"
        for v, a, b, total in held
    ]
    return lines


MOST_COLUMNS = 10
"""Frequencies shown of each nodal diameter on the terminal."""


def _hertz_line(frequency: Array, most: int = MOST_COLUMNS) -> str:
    """Columns of ten, of which the first stays empty: from 1e5 Hz on in whole Hz, from 1e9 on with
    two digits."""
    shown = frequency[:most]
    return "".join(
        f"{f:10.5g}" if f < 99999.5 else f"{f:10.0f}" if f < 1e9 else f"{f:10.2g}" for f in shown
    )


def _first(g: ModalGroup, columns: int) -> str:
    f, rigid = eigenmodes(g).frequency, int((g.omega == 0).sum())
    of = f"  of {g.n_modes - rigid}" if g.n_modes - rigid > columns else ""
    return f"{_hertz_line(f[f > 0], columns)}  Hz{of}{f' beside {rigid} rigid motions' if rigid else ''}"


FEW, ROWS = 5, 15
"""Frequencies of a line, and lines, that the end of a run shows."""


def frequency_lines(basis: ModalBasis) -> list[str]:
    """The first elastic frequencies of each speed and nodal diameter, a line each, in few lines for the terminal."""
    table = [
        f"{to_rpm(g.speed):8.6g} rpm{f', k = {k:3d}' if basis.sectors > 1 else ''}  {_first(g, FEW)}"
        for (_, k), g in sorted(basis.groups.items())[:ROWS]
    ]
    more = len(basis.groups) - ROWS
    return [*table, f"{'':8} and {more} lines more: microslip info shows them"] if more > 0 else table


def _ring_whirl(groups: list[ModalGroup]) -> list[str]:
    """A line of frequencies with gyroscopic coupling for each nodal diameter and wave, if a speed's groups hold it."""
    if (words := whirl_sentence(groups)) is None:
        return []
    lines = [f"  with gyroscopic coupling, in the rotating frame. {words}"]
    for g in groups:
        lines += [f"  k = {g.harmonic:3d}  {_hertz_line(f)}  Hz {way}" for way, (f, _) in waves_of(g).items()]
    bounds = 100 * whirl_bounds(groups)[:MOST_COLUMNS]
    if np.isfinite(bounds).any():
        shown = "".join(f"{b:10.2g}" if np.isfinite(b) else f"{'':10}" for b in bounds)
        lines.append(f"  at most  {shown}  % too high")
    return lines


def _ring_summary(basis: ModalBasis) -> list[str]:
    """A line of frequencies for each nodal diameter, at each speed."""
    lines = [f"one of {basis.sectors} cyclic sectors; the numbers above are of one"]
    for speed in speeds_of(basis):
        groups = [eigenmodes(basis.groups[speed, k]) for k in harmonics_of(basis)]
        first = basis.groups[speed, harmonics_of(basis)[0]]
        state = f"{to_rpm(first.speed):g} rpm" + (f", {first.prestress} prestress" * (first.prestress != "none"))
        known = between_stations([basis.groups[speed, k] for k in harmonics_of(basis)])
        lines.append(f"{state}: {known or certificate_words(certify_ring(basis, speed))}")
        if not certified_modes(first):
            lines.append(
                "  the frequencies below are those of the reduced sector, at or above the "
                "certified ones"
            )
        lines += contact_lines(first)
        lines += [f"  {text}" for text in sentences(first, basis.reduction)]
        for g in groups:
            more = f"   and {g.n_modes - MOST_COLUMNS} more" if g.n_modes > MOST_COLUMNS else ""
            lines.append(f"  k = {g.harmonic:3d}  {_hertz_line(g.frequency)}  Hz{more}")
        lines += _ring_whirl([basis.groups[speed, k] for k in harmonics_of(basis)])
    first = basis.groups[min(basis.groups)]
    if first.interfaces:
        lines.append(f"compliance at nodal diameter {first.harmonic}: {sentence(basis, first)}")
    return lines
