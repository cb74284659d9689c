"""What a response means for a body: the stress at its resonances, where, and how far from breaking.

From a response file and the body's modal file alone, whoever computed them and when.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, Indices, ModalBasis
from ..errors import UserError
from ..harmonic_balance.sweeps import prominent
from ..operating.fatigue import Endurance, MaterialLimits, endurance
from ..operating.motion import Motion
from ..operating.stress import CycleStress, StressPeaks, cycle_stress, stress_peaks
from ..results import Response, Series
from ..results.names import apart
from ..results.series import READ, unit_of
from ..units import METRES, Quantity
from .stage import Report

if TYPE_CHECKING:
    from ..operating.contact_maps import ContactMap

ENDLESS = MaterialLimits(fatigue_strength=1e29, tensile_strength=1e30)
"""Limits of a case that gives none: the worst place is then that of the largest amplitude."""


@dataclass(frozen=True)
class StressedResonance:
    """A local maximum of a sweep, and the range about it, between the lowest points next to it.

    Attributes:
        normal_force: N. frequency: Hz. amplitude: m, of the read-out that is drawn. range: Hz. stressed: number, in its
            series, of the point of that range at which the body's stress amplitude is largest, stressed_at: Hz there.
            worst: place of the body whose vibration may grow least there (largest amplitude without limits), outside
            the singular zones. singular: the same in them; None where the modal file has or names none.
    """

    normal_force: float
    frequency: float
    amplitude: float
    range: tuple[float, float]
    stressed: int
    stressed_at: float
    worst: Endurance
    singular: Endurance | None = None

    def holds(self, frequency: float) -> bool:
        """Whether a frequency (Hz) lies in its range."""
        return self.range[0] <= frequency <= self.range[1]


@dataclass(frozen=True)
class Assessment:
    """Stresses of one body in a response.

    Attributes:
        component: its name. sweeps: normal force (N) -> its series, the motion of that, and numbers and most stressed
            places of the points to draw (see `drawn_points`). resonances: of all series. limits: of the material, or
            None. quantity: what the read-out measures. everywhere: whether
            the points are enough for a curve over the frequency. lifted: normal force (N) -> which of the points to
            draw are not valid, because contacts would lift off; not_valid: those under which a resonance is not.
            unsure: normal force (N) and frequencies (Hz) -> where amplitudes are uncertain, or None.
            several: whether the response has other bodies too.
    """

    component: str
    sweeps: Mapping[float, tuple[Series, Motion, Array, StressPeaks]]
    resonances: tuple[StressedResonance, ...]
    limits: MaterialLimits | None
    quantity: Quantity = METRES
    everywhere: bool = True
    lifted: Mapping[float, Array] = field(default_factory=dict)
    not_valid: frozenset[float] = frozenset()
    unsure: Callable[[float, Array], Array] | None = None
    several: bool = False

    @property
    def whose(self) -> str:
        """Whose stresses, for titles."""
        return self.component if self.several else "the body"

    @property
    def highest(self) -> StressedResonance | None:
        """The resonance with the least margin (without limits, the most stressed one) of those that are valid."""
        key = (lambda r: r.worst.vibration) if self.limits else (lambda r: -r.worst.amplitude)
        valid = [r for r in self.resonances if r.normal_force not in self.not_valid]
        return min(valid or self.resonances, key=key, default=None)

    @property
    def slipping(self) -> StressedResonance | None:
        """The valid resonance at which the contacts slip for the largest share of the cycle; `highest` where none
        does."""
        valid = [r for r in self.resonances if r.normal_force not in self.not_valid]
        most = max(valid, key=self._slips, default=None)
        return self.highest if most is None or not self._slips(most) > 0 else most

    def _slips(self, r: StressedResonance) -> float:
        """Sum of the shares of the cycle in which its contacts slip."""
        arrays = self.sweeps[r.normal_force][0].arrays
        return sum(float(a[r.stressed]) for n, a in arrays.items() if n.endswith("/slipping"))

    def at(self, r: StressedResonance) -> tuple[Motion, CycleStress]:
        """Motion and stress where a resonance stresses the body most."""
        motion = self.sweeps[r.normal_force][1].at(r.stressed)
        return motion, cycle_stress(motion)

    def table(self) -> list[dict[str, Any]]:
        """Rows for the terminal and the report; lengths in m, stresses in Pa."""
        return [self._row(r) for r in self.resonances]

    def _row(self, r: StressedResonance) -> dict[str, Any]:
        row: dict[str, Any] = {
            "normal_force_N": r.normal_force,
            "frequency_Hz": r.frequency,
            self.quantity.column("amplitude"): r.amplitude,
        }
        row |= {"stress_amplitude_Pa": r.worst.amplitude, "frequency_of_stress_Hz": r.stressed_at}
        row |= {"mean_stress_Pa": r.worst.mean}
        if self.limits is not None:
            row["reserve_factor"] = r.worst.vibration
        row["location_mm"] = _millimetres(r.worst.point)
        if r.singular is not None:
            row["singular_stress_amplitude_Pa"] = r.singular.amplitude
            row["singular_location_mm"] = _millimetres(r.singular.point)
        return row


def _millimetres(point: Array) -> str:
    return " ".join(f"{1e3 * x:.1f}" for x in point)


def assess(
    response: Response, basis: ModalBasis, monitor: str, component: str = "", limits: MaterialLimits | None = None,
    report: Report = lambda _: None, everywhere: bool = True,
) -> Assessment:  # fmt: skip
    """The stresses of a body in a response; of a resonance the largest of its range, which need not be
    where the read-out is largest: another mode may stress the body on its flank.

    Args:
        monitor: name of the array whose first row says where resonances are. component: whose stresses; may be left out
            where there is one body. everywhere: at all points that a curve over the frequency needs, not just at as
            many as it takes to find the largest of each resonance.

    Raises:
        UserError: no stress modes at the nodes in the modal file, see `Response.motion`.
    """
    name = component or next(iter(response.bodies))
    sweeps, found = {}, list[StressedResonance]()
    for series in response.series:
        if not len(series.key):
            continue
        normal = float(series.parameters.get("normal_force", 0.0))
        report(f"stresses of {name} under a normal force of {normal:.6g} N")
        motion = response.motion(series, basis, name)
        size = abs(series.monitor(monitor)[:, 0, 1])
        chosen, at = drawn_points(series, *(DRAWN if everywhere else LOOKED_AT)), tops(series, size)
        peaks = stress_peaks(motion.at(chosen), largest=False)
        ranges = _ranges(peaks.amplitude, chosen, series.converged, at)
        most = [_most_stressed(motion, r, chosen, peaks) for r in ranges]
        if not np.isin(most, chosen).all():
            chosen = np.union1d(chosen, most)
            peaks = stress_peaks(motion.at(chosen), largest=False)
        sweeps[normal] = (series, motion, chosen, peaks)
        for i, r, j in zip(at, ranges, most, strict=True):
            cycle = cycle_stress(motion, j)
            worst, zones = endurance(cycle, limits or ENDLESS), np.flatnonzero(cycle.singular)
            beside = endurance(cycle, limits or ENDLESS, zones) if len(zones) else None
            f, low, high, there = (float(series.frequency[k]) for k in (i, r[0], r[-1], j))
            found.append(StressedResonance(normal, f, float(size[i]), (low, high), j, there, worst, beside))
    several = len(response.bodies) > 1
    return Assessment(name, sweeps, tuple(found), limits, _quantity(response, monitor), everywhere, several=several)


def _quantity(response: Response, monitor: str) -> Quantity:
    """What an array of read-outs measures."""
    names = {name for series in response.series for name in series.arrays}
    return Quantity(next((unit_of(n) for n in (f"{kind}{monitor}" for kind in READ) if n in names), "m"))


def _ranges(stress: Array, chosen: Array, known: Array, at: Indices) -> list[Indices]:
    """Points about each of the resonances `at`, in order, that belong to it: between where the stress (Pa, at those
    chosen) is lowest beside it. Where the read-out is lowest another mode may stress the body most."""
    if not len(at):
        return []
    points, sure = np.flatnonzero(known), known[chosen]
    seen, stress = chosen[sure], stress[sure]
    ends = [points[0], *at, points[-1]]
    lows = []
    for a, b in zip(ends[:-1], ends[1:], strict=True):
        between = (seen >= a) & (seen <= b)
        lows.append(seen[between][stress[between].argmin()])
    return [points[(points >= a) & (points <= b)] for a, b in zip(lows[:-1], lows[1:], strict=True)]


def _most_stressed(motion: Motion, around: Indices, chosen: Indices, peaks: StressPeaks) -> int:
    """The point of a range with the largest stress amplitude: of those chosen, whose peaks are known, then of all
    beside it."""
    inside = np.flatnonzero(np.isin(chosen, around))
    if len(inside):
        k = inside[peaks.amplitude[inside].argmax()]
        low, high = chosen[max(k - 1, 0)], chosen[min(k + 1, len(chosen) - 1)]
        around = around[(around >= low) & (around <= high)]
    return int(around[stress_peaks(motion.at(around), largest=False).amplitude.argmax()])


DRAWN, LOOKED_AT = (400, 20), (40, 2)
"""Points of a sweep that are drawn if it has more, and how many on either side of a resonance are drawn in any case;
and those at which stresses are looked at to find the largest ones."""


def drawn_points(series: Series, most: int = DRAWN[0], beside: int = DRAWN[1]) -> Array:
    """Numbers of the points of a sweep that a curve needs."""
    count = len(series.key)
    chosen = np.zeros(count, dtype=bool)
    chosen[np.linspace(0, count - 1, min(count, most)).round().astype(int)] = True
    for i in _searched(series):
        chosen[max(i - beside, 0) : i + beside + 1] = True
    return np.flatnonzero(chosen)


def _searched(series: Series) -> Indices:
    """Points of a series that were searched for between the others."""
    flags = series.arrays.get("peak", np.zeros(len(series.key)))
    return np.flatnonzero((np.asarray(flags) != 0) & series.converged)


def tops(series: Series, size: Array) -> Indices:
    """Points of a series that are resonances: those that were searched for between the others and are no folds, and of
    those of one plateau the highest, see `sweeps.prominent`. size: (f,) m, of the read-out."""
    folds = np.asarray(series.arrays.get("fold", np.zeros(len(series))), dtype=bool)
    points = np.flatnonzero(series.converged & ~folds)
    at = np.flatnonzero(np.isin(points, _searched(series)))
    return points[prominent(np.asarray(size)[points], at)]


def has_stresses(basis: ModalBasis, response: Response, component: str = "") -> bool:
    """Whether every group that a response needs has stress modes at the nodes and shapes."""
    body = response.bodies[component or next(iter(response.bodies))]
    for k in {k for k, _ in body.harmonics}:
        group = next((g for (s, h), g in basis.groups.items() if h == k and s in (body.speed, 0)), None)
        if group is None or "nodes" not in group.stresses:
            return False
    return True


# pictures and files ------------------------------------------------------------------------------------------------


def draw(
    found: Assessment, basis: ModalBasis, case: str, folder: Path, scenes: bool = True,
    maps: Mapping[str, list[ContactMap]] | None = None, contacts: int = 0,
) -> dict[str, Path]:  # fmt: skip
    """Stress over frequency and normal force, the most endangered body, its Haigh diagram, contact maps.

    Args:
        case: for titles. scenes: False leaves out what needs PyVista. maps: title -> patches.
            contacts: of the case, of which the patches may be some.

    Returns:
        Name -> file; names are those under which the report shows them.
    """
    from ..pictures import operating
    from ..pictures.plots import save

    drawn: dict[str, Path] = {}
    curves = {
        n: (s.frequency[i], np.where(s.converged[i], 1e-6 * p.amplitude, np.nan))  # MPa
        for n, (s, _, i, p) in found.sweeps.items()
    }
    if curves and found.everywhere:
        label, title = f"largest stress amplitude of {found.whose} in MPa", f"{case}: largest stress of {found.whose}"
        path, unsure = folder / "stress_over_frequency.png", found.unsure or operating.all_sure
        draw = partial(operating.over_frequency_plot, curves, label, title, lifted=found.lifted, unsure=unsure)
        drawn["stress over frequency"] = save(draw, path)
    if lines := over_force(found):
        label = f"largest stress amplitude of {found.whose} in MPa"
        title = f"{case}: largest stress of {found.whose} at its resonances"
        path, doubts = folder / "stress_over_normal_force.png", doubtful(found)
        plot = partial(operating.over_normal_force_plot, lines, label, title, lifted=found.not_valid, unsure=doubts)
        drawn["stress over normal force"] = save(plot, path)
    top = found.highest
    if top is not None:
        drawn |= _at_worst(found, top, basis, case, folder, scenes)
    rubs = found.slipping
    for title, patches in (maps or {}).items():
        path = folder / f"{title.replace(' ', '_')}.png"
        where = f", {rubs.stressed_at:.5g} Hz, $F_N$ = {rubs.normal_force:g} N" if rubs is not None else ""
        some = f"\n{len(patches)} of {contacts} contacts are shown" if len(patches) < contacts else ""
        words = f"{case}: {title}{where}{some}"
        drawn[title] = save(partial(operating.contact_map_plot, patches, words), path)
    return drawn


def families(found: Assessment) -> dict[str, list[StressedResonance]]:
    """Resonances followed over the normal force, from the largest down.

    A resonance goes on in one that lies in its range, or in whose range it lies: none other of its sweep is meant by
    that part of the band, however far the normal force has moved it. Of several the nearest in frequency; what is left
    begins a line of its own.
    """
    lines: list[list[StressedResonance]] = []
    for normal in sorted({r.normal_force for r in found.resonances}, reverse=True):
        new = [r for r in found.resonances if r.normal_force == normal]
        pairs = [
            (abs(np.log(line[-1].frequency / r.frequency)), i, j)
            for i, line in enumerate(lines)
            for j, r in enumerate(new)
            if line[-1].holds(r.frequency) or r.holds(line[-1].frequency)
        ]
        taken: dict[int, int] = {}
        for _, i, j in sorted(pairs):
            if i not in taken.values() and j not in taken:
                taken[j] = i
        for j, r in enumerate(new):
            if j in taken:
                lines[taken[j]].append(r)
            else:
                lines.append([r])
    lines.sort(key=lambda line: line[0].frequency)
    names = apart([line[0].frequency for line in lines], 4)
    return {f"near {name} Hz": line for name, line in zip(names, lines, strict=True)}


def over_force(found: Assessment) -> dict[str, list[tuple[float, float]]]:
    """Normal force, N, and stress amplitude, MPa, of families of resonances, none left out; nothing where there are
    fewer than three normal forces to look over."""
    lines = families(found)
    if len({r.normal_force for line in lines.values() for r in line}) < 3:
        return {}
    return {name: [(r.normal_force, 1e-6 * r.worst.amplitude) for r in line] for name, line in lines.items()}


def doubtful(found: Assessment) -> set[tuple[float, float]]:
    """Those of the pairs of `over_force` whose amplitude is uncertain."""
    unsure = found.unsure
    if unsure is None:
        return set()
    each = [(r, unsure(r.normal_force, np.array([r.frequency]))[0]) for r in found.resonances]
    return {(r.normal_force, 1e-6 * r.worst.amplitude) for r, doubt in each if doubt}


def _at_worst(
    found: Assessment, top: StressedResonance, basis: ModalBasis, case: str, folder: Path, scenes: bool
) -> dict[str, Path]:
    from ..pictures import operating
    from ..pictures.plots import save

    drawn: dict[str, Path] = {}
    motion, cycle = found.at(top)
    where = f"{top.stressed_at:.5g} Hz, $F_N$ = {top.normal_force:g} N"
    if found.limits is not None:
        haigh = partial(operating.haigh_plot, cycle, found.limits, top.worst, f"{case}: {where}")
        drawn["Haigh diagram"] = save(haigh, folder / "haigh.png")
    if scenes and basis.mesh.n_cells:
        from ..pictures.lettering import save_png
        from ..pictures.scene import quiet_vtk
        from ..pictures.views import open_studio

        quiet_vtk()
        studio = open_studio(basis)
        try:
            title = f"{case}: most stressed at {top.stressed_at:.5g} Hz under {top.normal_force:g} N"
            image = operating.stress_picture(studio, motion, cycle, title, found.limits, top.worst.place)
        finally:
            studio.stage.close()
        if image is not None:
            body = operating.turning_stress(basis, motion, cycle, title, found.limits)
            drawn["stress at resonance"] = save_png(image, folder / "stress_at_resonance.png", body)
    return drawn


def write_shape(found: Assessment, basis: ModalBasis, path: Path) -> Path | None:
    """The operating shape at the worst resonance as VTU; None without resonances, shapes or cells."""
    from ..operating.shape import write_shape_vtu

    top = found.highest
    if top is None or not basis.mesh.n_cells:
        return None
    try:
        write_shape_vtu(found.sweeps[top.normal_force][1].at(top.stressed), basis, path, found.limits)
    except UserError:
        return None
    return path
