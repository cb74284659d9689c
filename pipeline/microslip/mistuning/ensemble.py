"""Many samples, side by side and in order, kept so that a killed run goes on with the same bits."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array
from ..errors import UserError
from ..files import store
from ..interrupts import look
from ..process import prepare
from ..progress import Report
from ..settings.mistakes import whole
from ..units import counted, percent
from . import rare
from .batch import batch, solved
from .linear import beside, known_of
from .peaks import LEFT, Highest
from .ring import positive
from .samples import Asked, Sample, again, of_ring, sample
from .scatter import OF_CONTACTS
from .statistics import Envelope, Quantile, quantile

COLUMNS = ("amplitude", "frequency_Hz", "sector", "localisation", "missed", "unsolved", "at_end", "stress_Pa", "strain",
           "alone")  # fmt: skip
"""Of a sample, after its number."""

ALONE = 16
"""Samples that are solved one by one before others are solved together, whose program takes as long to compile."""

BLOCK = 32
"""Samples that are solved together: those of the same whole numbers of it, whoever asks for some of them."""

EACH = 4
"""Samples a worker gets, at least, before what is known is written."""

SHARE = 0.01
"""Of the samples that are known: so many are solved, at least, before those are sorted and written again."""

RARE = 0.999
"""Share of the samples below the quantile that samples are chosen for."""

FIRST = 1_000_000_000
"""Number of the first of the samples that are chosen from."""

BEFORE = 20
"""Plain samples, at least, that tell the correlation before others are chosen."""

UNSURE = 0.01
"""Share by which a peak may be higher yet from which on that is said."""

WATCHED = 0.95
"""Share of the samples below the quantile that progress shows, and that ends a run."""


@dataclass
class Ensemble:
    """Samples of a mistuned ring.

    Attributes:
        asked. tuned: the ring of equal sectors. rows: (n, len(COLUMNS)) of the samples. envelope: see `Envelope`. rare:
            the 99.9 % quantile by samples that a linear ring chose, see `rare.Rare`; None where none were asked for.
        again: the peak of the highest sample, searched for again (`search_again`); None before.
    """

    asked: Asked
    tuned: Sample
    rows: Array
    envelope: Envelope
    rare: rare.Rare | None = field(default=None)
    again: tuple[Highest, Highest] | None = field(default=None)

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        known = self.amplification[self.solved]
        said = f"amplification at most {known.max():.4g}" if len(known) else "none solved"
        return f"<Ensemble: {counted(len(self), 'sample')}, {said}>"

    def column(self, name: str) -> Array:
        """(n,) one of `COLUMNS`."""
        return self.rows[:, COLUMNS.index(name)]

    @property
    def solved(self) -> Array:
        """(n,) bool, samples whose highest peak is known."""
        return np.isfinite(self.column("amplitude"))

    @property
    def unsure(self) -> list[str]:
        """Warnings, in sentences: of the tuned ring's peak, by which amplifications are divided, and of samples."""
        warnings, top = [], self.tuned.top
        if top.at_end:
            warnings.append(
                "the tuned ring is highest at an end of the band, so amplifications are over no peak of it; widen the "
                "sweep."
            )
        elif top.missed > UNSURE:
            warnings.append(f"the tuned ring may be {_missed(top.missed)}")
        ends, off = int(np.nansum(self.column("at_end"))), self.column("missed") > UNSURE
        if ends:
            warnings.append(f"in {counted(ends, 'sample')} the highest is at an end of the band; widen the sweep.")
        if off.any():
            most = float(self.column("missed")[off].max())
            warnings.append(f"{counted(int(off.sum()), 'sample')} may be {_missed(most)}")
        if self.again and (low := self.lacked) > LEFT + float(self.column("missed")[self.highest]):
            warnings.append(
                f"the first search missed {percent(low)} of the highest sample's peak, so others and the quantiles may "
                "be as low; give the sweep more points."
            )
        if unsolved := int((self.column("unsolved") > 0).sum()):
            warnings.append(
                f"in {counted(unsolved, 'sample')} no solution was found at some frequencies of the sweep (column "
                "unsolved); give it more points."
            )
        return warnings

    @property
    def amplification(self) -> Array:
        """(n,) highest amplitude of any blade over that of the tuned ring; NaN where it is not known."""
        return self.column("amplitude") / self.tuned.top.amplitude

    @property
    def lacked(self) -> float:
        """Share by which the highest sample's peak is higher by the searches that came after its own; 0 before."""
        high = [top.amplitude for top in self.again or ()]
        return max([0.0, *(h / self.column("amplitude")[self.highest] - 1 for h in high)])

    @property
    def highest(self) -> int:
        """Number of the sample with the highest blade of all."""
        return int(np.nanargmax(self.amplification))

    def search_again(self) -> Sample:
        """The highest sample solved once more, as it was; and its peak searched for again, see `samples.again`."""
        one = sample(self.asked, self.highest)
        self.again = again(self.asked, one)
        return one

    def quantile(self, share: float, confidence: float = 0.95) -> Quantile:
        """Of the amplification."""
        return quantile(self.amplification[self.solved], share, confidence)


def run(
    asked: Asked, samples: int, until: float | None = None, workers: int | None = None, file: Path | None = None,
    inputs: str = "", executor: Executor | None = None, report: Report = lambda _: None,
) -> Ensemble:  # fmt: skip
    """Samples until there are so many, or the interval of the 95 % quantile is narrow enough.

    Args:
        samples: one, where nothing is drawn. until: half of that interval over the quantile. workers: processes; as
            many as there are cores, and one for a few samples, if None. file: where the run is kept (.npz); with the
            same inputs it goes on. executor: in the place of own processes, such as that of a cluster.
    """
    for name, value in (("samples", samples), ("workers", 1 if workers is None else workers)):
        whole(name, value, ge=1)
    samples = samples if any(s.random for s in asked.scatter) else 1
    report("the tuned ring")
    tuned = of_ring(asked, asked.tuned.whole, -1)
    if not np.isfinite(tuned.top.amplitude):
        raise UserError("mistuning: the tuned ring has no solution in the band; see what microslip respond says of it")
    rows, envelope = np.zeros((0, len(COLUMNS))), Envelope.empty(len(asked.frequency), tuned.top.amplitude)
    kept = _left(file, inputs)
    if kept.keys() >= {"rows", "sums", "bins", "grids"} and kept["rows"].ndim == 2:
        rows = kept["rows"]
        envelope = Envelope(envelope.unit, kept["sums"], kept["bins"], list(kept["grids"]))
    found = Ensemble(asked, tuned, rows, envelope)
    if len(found) > samples:
        found.rows, found.envelope = found.rows[:samples], found.envelope.first(samples)
    workers = workers or min(_cores(), -(-samples // EACH))
    at_least = workers * (EACH if batch(asked) is None else BLOCK)
    with _computed(asked, workers, executor) as of:
        while len(found) < samples and not _narrow(found, until):
            _more(found, of, min(samples, _next(len(found), at_least)), until, samples, report)
            e = found.envelope
            _keep(file, inputs, rows=found.rows, sums=e.sums, bins=e.bins, grids=np.array(e.grids))
    if len(found) < samples:
        report(f"{len(found)} of {len(found)} samples{_told(found)}, the rest was not needed")
    return found


def _more(
    found: Ensemble, of: Callable[[Sequence[int]], Iterator[Sample]], end: int, until: float | None, samples: int,
    report: Report,
) -> None:  # fmt: skip
    """Samples up to a number, or as many as are enough, which does not depend on how many are solved side by side."""
    made, told, judged = list[list[float]](), _told(found), _next(len(found))
    for number, one in zip(range(len(found) + 1, end + 1), of(range(len(found), end)), strict=True):
        found.envelope.add(one.grid)
        solved, top = np.isfinite(one.top.amplitude), one.top
        unsolved = np.isnan(one.grid).all(axis=1).sum()  # what the search added elsewhere in vain is in `missed`
        made.append(
            [top.amplitude, top.frequency, top.output, one.localisation if solved else np.nan, top.missed,
             unsolved, top.at_end, one.stress, one.strain, one.alone]  # fmt: skip
        )
        report(f"{number} of {samples} samples{told}")
        if number in (judged, end):
            found.rows, made, judged = np.vstack([found.rows, made]), [], _next(number)
            if number == end or _narrow(found, until):
                return
            told = _told(found)


def _next(known: int, more: int = 1) -> int:
    """Number of samples, so many more at least, at which it is judged whether they are enough."""
    judged = 0
    while judged < known + more:
        judged += max(EACH, int(SHARE * judged))
    return judged


DRAWN = 100_000
"""Samples that are drawn before the first one is solved, in some seconds."""


def ready(asked: Asked, samples: int, chosen: int) -> None:
    """Raise `UserError` before anything is solved, where one of so many samples cannot be, or where `choose` could not
    choose after them."""
    whole("samples", samples, ge=0)
    for number in range(min(samples, DRAWN)):
        for s, values in asked.deviations(number):
            positive(s, values)
    felt(asked)
    whole("rare", chosen)
    if chosen:
        if not any(s.random for s in asked.scatter):
            raise UserError("rare: nothing is drawn, so all samples are one ring; leave it out")
        known_of(asked)
        if samples < BEFORE:
            raise UserError(f"rare: {samples} plain samples tell too little of the linear ring; ask for {BEFORE}")


def felt(asked: Asked) -> None:
    """Raise `UserError` where contacts stick, and what scatters in them does not change their stiffness."""
    for s, values in asked.deviations(0) if asked.stuck else ():
        if s.of not in OF_CONTACTS or not values.any():
            continue
        if np.array_equal(asked.tuned.mistuned([(s, values)]).stiffness, asked.tuned.whole.stiffness):
            raise UserError(f"{s.of}: nothing depends on it where contacts stick (stuck); leave one of both out")


def choose(
    found: Ensemble, samples: int, workers: int | None = None, file: Path | None = None, inputs: str = "",
    executor: Executor | None = None, report: Report = lambda _: None,
) -> rare.Rare:  # fmt: skip
    """The 99.9 % quantile of the amplification by about so many samples that a linear ring chooses, see `rare`.

    Args: found: plain samples. The others are those of `run`.

    Raises:
        UserError: fewer plain samples than `BEFORE`; blades whose modes do not scatter.
    """
    asked, known = found.asked, found.solved
    ready(asked, int(known.sum()), samples)
    report(f"{rare.EACH * samples} samples of the linear ring")
    linear = beside(asked)
    before = np.array([linear(asked.deviations(int(i))) for i in np.flatnonzero(known)])
    correlated = rare.correlation(before, found.amplification[known])
    every = np.array([linear(asked.deviations(FIRST + i)) for i in range(rare.EACH * samples)])
    pi = rare.chances(every, samples, RARE, correlated, int(known.sum()))
    chosen, inputs = rare.chosen(pi, asked.seed), f"{inputs} {len(found)} {samples}"
    high = _left(file, inputs).get("high", np.zeros(0))
    workers = workers or _cores()
    with _computed(asked, workers, executor) as of:
        while len(high) < len(chosen):
            part = chosen[len(high) : len(high) + BLOCK * workers]
            high = np.append(high, [one.top.amplitude for one in of([FIRST + int(i) for i in part])])
            report(f"{len(high)} of {len(chosen)} chosen samples")
            _keep(file, inputs, high=high)
    solved = np.isfinite(high)
    return rare.estimate(high[solved] / found.tuned.top.amplitude, pi[chosen][solved], len(pi), RARE, correlated)


def _missed(share: float) -> str:
    why = "it jumps or bends there, or the sweep is coarse; give the sweep more points"
    return f"up to {percent(share)} higher between two points: {why}."


def _narrow(found: Ensemble, until: float | None) -> bool:
    return until is not None and len(found) >= EACH and found.quantile(WATCHED).width <= until


def _told(found: Ensemble) -> str:
    """The quantile that is watched, of the samples that are known."""
    if len(found) < EACH:
        return ""
    return f": {100 * WATCHED:g} % quantile of the amplification {found.quantile(WATCHED)}"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _computed(
    asked: Asked, workers: int, executor: Executor | None
) -> Iterator[Callable[[Sequence[int]], Iterator[Sample]]]:  # fmt: skip
    together = batch(asked) is not None
    ready = dict[int, Sample]()  # solved beside others

    def of(numbers: Sequence[int]) -> Iterator[Sample]:
        found = each(_pieces([n for n in numbers if n not in ready], together))
        for n in numbers:
            while n not in ready:
                ready.update((one.number, one) for one in next(found))
            yield ready.pop(n)

    def each(pieces: list[list[int]]) -> Iterator[list[Sample]]:
        if executor is not None:
            yield from executor.map(several, [asked] * len(pieces), pieces)
        elif workers == 1:
            yield from (several(asked, piece) for piece in pieces)
        else:
            yield from _in_order([pool.submit(_own_several, piece) for piece in pieces])

    if workers == 1 or executor is not None:
        yield of
        return
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin, (asked,))
    try:
        yield of
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)  # the command line ends what they are at
        raise
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def _pieces(numbers: list[int], together: bool) -> list[list[int]]:
    """Samples that are solved together: of `BLOCK` numbers all, lest bits depend on which are asked for; of chosen ones
    as many in their order."""
    plain = [n for n in numbers if n < (FIRST if together else np.inf)]
    first = ALONE if together else len(plain) and plain[-1] + 1
    alone = [[n] for n in plain if n < first]
    blocks = sorted({(n - first) // BLOCK for n in plain if n >= first})
    chosen = numbers[len(plain) :]
    return [
        *alone, *(list(range(first + BLOCK * b, first + BLOCK * (b + 1))) for b in blocks),
        *(chosen[i : i + BLOCK] for i in range(0, len(chosen), BLOCK)),
    ]  # fmt: skip


def several(asked: Asked, numbers: Sequence[int]) -> list[Sample]:
    """Samples, one by one or together."""
    together = batch(asked) if len(numbers) > 1 else None
    return [sample(asked, n) for n in numbers] if together is None else solved(together, numbers)


def _in_order(awaited: Sequence[Future[Any]]) -> Iterator[Any]:
    """Answers as they are wanted; nothing is waited for in C, where a request to end would wait too."""
    try:
        for one in awaited:
            while not one.done():
                look()
                wait([one], store.POLLED)
            yield one.result()
    finally:
        for one in awaited:
            one.cancel()


_own: Any = None


def _begin(asked: Asked) -> None:
    global _own
    prepare()
    _own = asked
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal asks all; who began them ends them


def _own_several(numbers: Sequence[int]) -> list[Sample]:
    return several(_own, numbers)


def _keep(file: Path | None, inputs: str, **arrays: Array) -> None:
    if file is not None:
        with store.complete_or_absent(file) as temporary:
            np.savez(temporary, **arrays, inputs=np.array(inputs))  # type: ignore[arg-type]


def _left(file: Path | None, inputs: str) -> dict[str, Array]:
    """The arrays that a run with the same inputs has left; none where there is none."""
    try:
        if file is not None and file.is_file():
            with np.load(store.ordinary(file), allow_pickle=False) as known:
                if str(known["inputs"]) == inputs:
                    return {name: np.array(known[name]) for name in known.files}
    except (OSError, ValueError, KeyError):
        pass
    return {}
