"""Running a case: responses at every normal force, resonances, what a reader must know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray, ModalBasis
from ..errors import UserError, at, in_its_file
from ..harmonic_balance import FrequencyResponse
from ..harmonic_balance.accuracy import FLOOR, enough, judged
from ..harmonic_balance.book import normal_law
from ..harmonic_balance.checkpoint import labels, resumed_response
from ..harmonic_balance.forces import GIB
from ..harmonic_balance.growing import verdict
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..harmonic_balance.reduced import stuck, stuck_damping
from ..harmonic_balance.response import HarmonicResponse, Resonance, filled_response, parted, refined_peaks
from ..harmonic_balance.sweeps import gaps, still
from ..results import Journal
from ..results.checks import UNCERTAIN
from ..system.assembly import Linear
from ..units import Quantity, counted, percent
from . import edges, headline
from . import messages as say
from .assemble import Built, build
from .beyond import Beyond, beyond
from .checkpoint import series_name
from .contacts import memory_of
from .edges import Rising
from .problem import normal_forces, pressed_by, problem_of
from .readouts import Readout, readouts
from .settings import FIRST_HARMONICS, CaseSettings
from .weak_springs import raising

Keep = Callable[[Built], AbstractContextManager[Journal]]
Peaks = list[tuple[float, float]]
"""Hz and amplitude of each."""


@dataclass(frozen=True)
class CaseResult:
    """Responses by normal force (N), the free response, and the eigenfrequencies with sticking contacts (Hz).

    stuck_damping: ratio D of each of them, so that its half-power width is 2 D f.

    resonances: normal force -> (frequency in Hz, amplitude in m) of each peak, searched for between the points of the
    sweep. speed: rad/s. messages: sentences a reader must know. built: the assembly. rising: ends of the band at which
    responses still rise. truncation: largest estimated error of an amplitude for want of harmonics and samples, over
    it; None where it is not estimated. errors: normal force (N) -> frequency in Hz -> what the amplitude is likely to
    be off by, over it, above 0 where it is too high, NaN where nobody knows: of resonances, the highest point and where
    most is left out. folds: normal force -> (Hz, m) where the response is highest and its curve ends, which is no
    resonance. beyond: motions in time about jumps and gaps, where they were asked for.
    """

    settings: CaseSettings
    responses: dict[float, HarmonicResponse]
    free: FrequencyResponse
    stuck: Array
    resonances: dict[float, list[tuple[float, float]]]
    speed: float
    messages: tuple[str, ...]
    built: Built
    rising: tuple[Rising, ...] = ()
    truncation: float | None = None
    stuck_damping: Array = field(default_factory=lambda: np.zeros(0))
    errors: Mapping[float, Mapping[float, float]] = field(default_factory=dict)
    folds: Mapping[float, list[tuple[float, float]]] = field(default_factory=dict)
    beyond: tuple[Beyond, ...] = ()

    @property
    def quantity(self) -> Quantity:
        """What the first read-out measures."""
        return measured(self.built.assembly)

    def unsure(self, normal: float, frequency: Array) -> Array:
        """(f,) bool, frequencies (Hz) at which the amplitude is likely to be off by more than `UNCERTAIN`, from what is
        known of the points that are judged on either side."""
        if not (known := self.errors.get(normal)):
            return np.zeros(len(frequency), dtype=bool)
        at = sorted(known)
        share = np.nan_to_num(np.abs([known[f] for f in at]), nan=1.0)
        return np.asarray(np.interp(frequency, at, share) > UNCERTAIN)

    @property
    def readouts(self) -> list[Readout]:
        """What is read, each once; of a ring that is answered as a whole what its first sector reads."""
        asked = readouts(self.built.assembly)
        return readouts(self.built.pressed(None))[: len(asked)]


@in_its_file
def run_case(
    settings: CaseSettings, basis: ModalBasis | Mapping[str, ModalBasis],
    report: Callable[[str], None] = lambda _: None, keep: Keep | None = None, begin: int = FIRST_HARMONICS,
) -> CaseResult:  # fmt: skip
    """Frequency responses at every normal force.

    With ``harmonics = "auto"`` all of them have as many as the most demanding resonance needs: the sweeps begin with
    few, and begin anew with more where a resonance turns out to need them.

    Args:
        basis: the modal file, or the body of the case -> its modal file where there are several. keep: opens the
            journal of an assembly, in which every finished point is kept and those of an earlier run are found; without
            it nothing is kept. begin: harmonics to begin with, where their number is looked for.

    Raises:
        UserError: names that the modal files do not hold, see `assemble.build`.
    """
    bases = basis if isinstance(basis, Mapping) else {b.name: basis for b in settings.components}
    tolerance, own = None, settings
    if settings.looks_for_harmonics:
        tolerance, own = settings.harmonics_error or headline.TRUNCATION, settings.with_harmonics(begin)
    while True:
        run = _Run(build(own, bases), tolerance, report)
        _book_can(run.built)
        forces = normal_forces(run.built)
        with at("sweep.normal_forces"):  # before anything is kept
            for normal in forces:
                run.built.pressed(normal)
        with keep(run.built) if keep else nullcontext() as journal:
            enough = all(run.respond(normal, journal) for normal in forces or (None,))
        if enough:
            return run.result(max(forces, default=None))
        own = settings.with_harmonics(run.needed)


class _Run:
    """Responses of a case with one number of harmonics, as they are found; see `CaseResult`.

    tolerance: of their error, where their number is looked for; None: it is given. needed: how many a resonance
    turned out to need. lost: normal force (N) -> Hz, where no solution with more of them was found, and nobody knows
    the error.
    """

    def __init__(self, built: Built, tolerance: float | None, report: Callable[[str], None]) -> None:
        self.built, self.tolerance, self.report = built, tolerance, report
        self.frequency = built.settings.sweep.grid
        self.responses: dict[float, HarmonicResponse] = {}
        self.resonances, self.folds = dict[float, Peaks](), dict[float, Peaks]()
        self.errors, self.lost = dict[float, dict[float, float]](), dict[float, list[float]]()
        self.stuck = self.stuck_damping = np.zeros(0)
        self.messages, self.needed = list[str](), 0
        self.truncation: float | None = None
        _report_memory(built, report)

    def respond(self, normal: float | None, journal: Journal | None) -> bool:
        """The response under a normal force (N; None: the contacts have their own), its peaks, and what speaks against
        it; False where it needs more harmonics, see `needed`."""
        built, problem = self.built, problem_of(self.built, normal)
        key = pressed_by(built, problem) if normal is None else normal
        self.report(f"friction response at a normal force of {key:g} N")
        if journal is None:
            found = filled_response(problem, self.frequency, self.report)
            peaks = refined_peaks(problem, found)
        else:
            name = series_name(key)
            parameters = {**journal.head.get("parameters", {}), name: {"normal_force": key}}
            journal.say({**journal.head, "parameters": parameters, "labels": labels(problem.assembly)})
            found, peaks = resumed_response(problem, self.frequency, journal, name, self.report)
        peaks, turns = parted(found, peaks)
        self.responses[key] = found
        self.folds[key] = [(fold.frequency, fold.amplitude) for fold in turns]
        self.resonances[key] = [(peak.frequency, peak.amplitude) for peak in peaks]
        self.messages += say.not_periodic(key, found.unsteady, built.settings)
        self.messages += say.lifting(built, problem, found, key) + say.pulling(built, found, key)
        self.messages += say.across(problem, found, key) + _verdict(problem, found, key)
        if key == max(self.responses):
            part = problem.assembly.joined(1)
            stiffness = problem.assembly.stiffness
            self.stuck, self.stuck_damping = stuck(part, stiffness), stuck_damping(part, stiffness)
        return still(found) or self._judge(problem, found, peaks, key, journal)

    def _judge(
        self, problem: Problem, found: HarmonicResponse, peaks: list[Resonance], key: float, journal: Journal | None
    ) -> bool:  # fmt: skip
        """What harmonics and samples that are left out would change at the places that are judged
        (`accuracy.judged`); False where more harmonics are needed, and would be enough."""
        if not headline.is_estimated(self.built, problem, ring=self.tolerance is not None):
            return True
        looked_at = judged(problem, found, peaks, journal, series_name(key))
        for look in looked_at if self.tolerance is not None else ():
            floor = FLOOR * float(np.abs(found.monitor[found.converged]).max(initial=0.0))
            more = enough(problem, look.point, self.tolerance or 0.0, floor=floor, first=look.error)
            self.needed = more.problem.harmonics
            if self.needed > problem.harmonics:
                self.report(
                    f"at F_N = {key:g} N and {look.point.Omega / (2 * np.pi):.6g} Hz an error of about "
                    f"{percent(look.bound)} is left with {counted(problem.harmonics, 'harmonic')}; all once more with "
                    f"{self.needed}"
                )
                return False
        if not looked_at:
            return True
        self.errors[key] = {look.point.Omega / (2 * np.pi): look.likely for look in looked_at}
        if unknown := [look.point.Omega / (2 * np.pi) for look in looked_at if not np.isfinite(look.bound)]:
            self.lost[key] = unknown
        point, e, share, likely = max(looked_at, key=lambda look: look.bound)
        self.truncation = max(self.truncation or 0.0, share)
        where = f"At F_N = {key:g} N the amplitude at {point.Omega / (2 * np.pi):.6g} Hz"
        if np.isfinite(share) and share > (self.tolerance or headline.TRUNCATION):
            self.messages.append(
                headline.uncertain(where, e, share, likely)
                if self.tolerance is None
                else f"{where} is uncertain by about {percent(share)} with {counted(problem.harmonics, 'harmonic')}, "
                "above harmonics_error; no solution with more was found."
            )
        return True

    def result(self, largest: float | None) -> CaseResult:
        """All of it, with what a reader must know. largest: normal force (N) that the sweep presses by."""
        built, settings, responses = self.built, self.built.settings, self.responses
        idle = [normal for normal, r in responses.items() if still(r)]
        self.resonances |= {normal: [] for normal in idle}
        rising = edges.rising({n: r for n, r in responses.items() if n not in idle}, self.resonances)
        messages = [
            *built.messages,
            *say.by_the_book(built),
            *say.between_equilibria(built),
            *raising(built, largest),
            *say.of_stuck_modes(built, largest),
            *self.messages,
            *self._unknown(),
            *say.too_coarse(settings, self.stuck, self.stuck_damping),
            *say.not_converged(responses),
            *say.not_found(responses, self.resonances),
            *say.idle(idle),
            *say.folded(self.folds, measured(built.assembly)),
            *headline.doubted(built, largest_of(responses), largest),
            *say.overhangs(responses, self.resonances),
            *edges.messages(rising),
        ]
        return CaseResult(
            settings, responses, free_response(built, self.frequency), self.stuck, self.resonances, built.speed,
            tuple(messages), built, tuple(rising), self.truncation, self.stuck_damping, self.errors, self.folds,
        )  # fmt: skip

    def _unknown(self) -> list[str]:
        """A message on all places whose error nobody knows, and what to do about them."""
        if not self.lost:
            return []
        s = self.built.settings
        return [
            f"With twice the harmonics and samples no solution was found {say.at_places(self.lost)}, so how uncertain "
            f"amplitudes are there is not known: respond with more of them (harmonics = {2 * s.balanced}, samples = "
            f"{2 * s.sampled}; its points begin at their neighbours) and more sweep.points there; if these fail too, "
            "microslip respond CASE --stability tells whether what was found is stable."
        ]


def largest_of(responses: Mapping[float, HarmonicResponse]) -> float:
    """The largest amplitude of the first read-out, in its unit, of all points that are solutions."""
    return max((float(np.abs(r.monitor[r.converged]).max(initial=0.0)) for r in responses.values()), default=0.0)


def jumps(result: CaseResult) -> list[tuple[float | None, float, tuple[float, float]]]:
    """Where responses jump or leave a gap: the normal force that was asked for and its key, Hz and Hz; the book's mode
    has none."""
    if result.settings.mode == "book" or not result.settings.sweep.patience:
        return []
    forces = dict.fromkeys(normal_forces(result.built) or (None,))
    return [
        (asked, normal, gap)
        for asked, (normal, r) in zip(forces, result.responses.items(), strict=True)
        for gap in gaps(r, result.resonances[normal])
    ]


def with_motions(
    result: CaseResult,
    report: Callable[[str], None] = lambda _: None,
    keep: Keep | None = None,
) -> CaseResult:
    """The same with motions in time where responses jump. keep: opens their journal, see
    `run_case`."""
    patience, of, built = result.settings.sweep.patience, result.quantity, result.built
    if not (places := jumps(result)):
        return result
    with keep(built) if keep else nullcontext() as journal:
        found = [
            beyond(problem_of(built, asked), result.responses[n], gap, n, of, report, patience, journal)
            for asked, n, gap in places
        ]
    return replace(result, beyond=tuple(found))


def _verdict(problem: Problem, found: HarmonicResponse, normal: float) -> list[str]:
    """Whether the highest point is stable, where the linear part feeds motions."""
    if not found.converged.any():
        return []
    i = int(np.argmax(np.where(found.converged, np.abs(found.monitor), -1.0)))
    f = float(found.frequency[i])
    at = f"At F_N = {normal:g} N the highest motion, at {f:.6g} Hz,"
    return verdict(problem, found.x[i], 2 * np.pi * f, at)


def _report_memory(built: Built, report: Callable[[str], None]) -> None:
    """The memory of the contacts' points, where it is more than a GiB."""
    s, patches = built.settings, [c.patch for c in built.assembly.contacts]
    needed = max((memory_of(s, len(p.points), p.count) for p in patches), default=0.0) / GIB
    if needed > 1:
        points = max(len(p.points) for p in patches)
        report(f"up to {points} points, {s.balanced} harmonics, {s.sampled} samples: about {needed:.3g} GiB of memory")


def _book_can(built: Built) -> None:
    """Say which contact the book's mode cannot be made of.

    Raises:
        UserError: a law that is not the book's.
    """
    if built.settings.mode != "book":
        return

    for c in built.assembly.contacts:
        try:
            normal_law(c.patch.law, built.settings.strips)
        except UserError as error:
            more = ", or isotropic = true in a curved contact" if "along t1 and t2" in str(error) else ""
            raise UserError(f'{error}{more}, or write mode = "aft"', f"contacts.{c.name}") from error


def free_response(built: Built, frequency: Array) -> FrequencyResponse:
    """The first read-out without any contact, over frequency (Hz) and, between its ends, over every resonance."""
    a = replace(built.assembly, contacts=())
    output = a.outputs[0]
    component = next(m for m in a.components if m.name == output.component)
    part = replace(
        a, components=(component,), loads=tuple(x for x in a.loads if x.component == component.name),
        outputs=tuple(w for w in a.outputs if w.component == component.name),
    ).joined(1)  # fmt: skip
    frequency = np.union1d(frequency, _about_resonances(part, frequency))
    portions = np.array_split(2 * np.pi * frequency, len(frequency) // 256 + 1)
    q = np.concatenate([_moved(part, Omega) for Omega in portions])
    zero, none = np.zeros(len(frequency)), np.zeros((len(frequency), 0))
    moved = q @ part.output[0] + part.output_given[0]
    return FrequencyResponse(frequency, moved, none, zero, np.ones(len(frequency), dtype=bool))


def _moved(part: Linear, Omega: Array) -> ComplexArray:
    """(f, m) coordinates of a body alone under its loads, Omega in rad/s."""
    at = Omega[:, None, None]
    A = part.stiff - at**2 * part.M + 1j * at * part.C
    return np.linalg.solve(A, np.broadcast_to(part.load[:, None], (len(A), len(part.load), 1)))[..., 0]


def _about_resonances(part: Linear, frequency: Array) -> Array:
    """Hz between the ends of a sweep, about the resonances of a body alone, dense against their widths.

    A peak between two of them is drawn too low by 0.2 % at most. One without damping has no height to be drawn.
    """
    n, unit = len(part.M), np.sqrt(np.linalg.norm(part.K) / np.linalg.norm(part.M)) or 1.0  # rad/s
    zero, one = np.zeros((n, n)), np.eye(n)
    A = np.block([[zero, one], [-part.stiff / unit**2, -part.C / unit]])
    roots = unit * scipy.linalg.eigvals(A, scipy.linalg.block_diag(one, part.M))
    roots = roots[np.isfinite(roots) & (roots.imag > 0) & (roots.real < 0)]
    apart = np.sinh(np.linspace(-5.5, 5.5, 101))
    found = (roots.imag - apart[:, None] * roots.real).ravel() / (2 * np.pi)
    return found[(found > frequency[0]) & (found < frequency[-1])]
