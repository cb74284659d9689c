"""Bodies that touch each other or the ground, and what drives them: the equation of motion of every analysis.

With the coordinates q of all components and their relative motions d = T q at the contacts (Sextro Eqs. (5.1-4) to
(5.1-13)),

    M q'' + (C + G) q' + K q + T^T (F(u_0 + d) - F_0) = f(t)

F are the contact forces by their laws, u_0 and F_0 displacement and force of a preloaded contact, from which d counts.
Everything linear is handed out harmonic by harmonic, because a component of a ring has other matrices in each of them:
the harmonic h of a travelling wave whose base engine order is e moves the N sectors with the nodal diameter
h e mod N.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

from ..data import INTERFACE_ROWS, Array, ComplexArray, Indices
from ..errors import UserError
from ..settings.mistakes import bounded
from .component import Component, InWave, Ring
from .disc import Flow, directed, spread, through, whole
from .ground import Ground

if TYPE_CHECKING:
    from ..contact.patch import Patch


@dataclass(frozen=True, eq=False)
class ContactFace:
    """One of the two faces of a contact.

    Attributes:
        component, interface: names. frame: (k, 6) motion along the contact's coordinates, in the contact's frame, per
            unit of the interface's six rows. shift: the component stands that many sectors further than the one whose
            coordinates are used (of a sector that stands for a ring).
        rows: index of a ring -> (k, m) motion along the contact's coordinates, of a patch that deforms; else None.
    """

    component: str
    interface: str
    frame: Array = field(default_factory=lambda: np.eye(6))
    shift: int = 0
    rows: Mapping[int, Array] | None = None

    def motion(self, linear: InWave, index: int, blades: int) -> Array:
        """(k, m) motion per unit of the component's coordinates, with the phase of the sector it stands in."""
        if self.rows is None:
            own = self.frame @ linear.interface(self.interface)
        elif index in self.rows:
            own = self.rows[index]
        else:
            own = self.rows[0] if len(self.rows) == 1 else self.rows[(blades - index) % blades].conj()
        return own * self.phase(index, blades)

    def phase(self, index: int, blades: int) -> complex | float:
        """Of the sector that the component stands in, against the one whose coordinates are used."""
        steps = (self.shift * index) % blades if blades else 0
        if 2 * steps in (0, blades):
            return -1.0 if steps else 1.0
        return complex(np.exp(2j * np.pi * steps / blades))

    @property
    def labels(self) -> list[str]:
        """Compliance labels of the six rows."""
        return [f"interface:{self.interface}:{row}" for row in INTERFACE_ROWS]


@dataclass(frozen=True, eq=False)
class Contact:
    """Two faces that touch, or one and the ground, which does not move.

    The relative motion d = first - second, seen in the frame of the first: its normal entry is positive where the two
    come nearer.

    Attributes:
        name. patch: points and law. first, second: sides; None: the ground.
        offset: (k,) relative displacement of the preloaded state, m and rad. preload: (k,) force that is in balance
            there with loads which nothing else of the assembly tells of, N and N m. Zeros where loads, interference
            and the contact find their balance in the analysis itself.
        phase: radians by which the wave leads here in the first harmonic. Laws are marched from where the wave is at
            zero phase: what a contact remembers of its beginning is then the same in every sector of a ring.
        compliance: (k, k) of the bodies along the coordinates, by which a patch that deforms yields to its preload.
        ground: how the other side moves, of a motion in time; None: it stands still.
        length: m, about what it has to move by to slide, close or bend; None: what preload and offset say.
    """

    name: str
    patch: Patch
    first: ContactFace
    second: ContactFace | None
    offset: Array
    preload: Array
    phase: float = 0.0
    compliance: Array | None = None
    length: float | None = None
    ground: Ground | None = None

    @cached_property
    def stiffness(self) -> Array:
        """(k, k) about which the analysis is made: that of the sticking contact where it is preloaded."""
        from ..contact.elements import Spring
        from ..contact.patch import stuck_stiffness
        from ..contact.set_valued import REFUSED, SetValued

        if isinstance(self.patch.law, SetValued):
            raise UserError(f"{'element ' if self.patch.count == 1 else 'contacts.'}{self.name}: {REFUSED}")
        if isinstance(self.patch.law, Spring) and self.patch.count == 1:  # at a displacement at which it bends
            slope = abs(float(self.patch.law.slope(2 * (self.length or 0.0))))
            return slope * float(self.patch.kinematics[0, 1, 0]) ** 2 * np.eye(1)
        preloaded, at = stuck_stiffness(self.patch, self.offset), np.zeros_like(self.offset)
        if preloaded[0, 0] > 0 or self.preload[0] > 0:
            return preloaded
        for at[0] in 1e-9 * 4.0 ** np.arange(10):  # open in that state: it will be pressed by something
            k = stuck_stiffness(self.patch, at)
            if k[0, 0] > 0:
                return k
        return preloaded

    def pressed(self, normal: float) -> Contact:
        """The contact under another normal force (N)."""
        found = preloaded_contact(
            self.name, self.patch, self.first, self.second, normal=normal, compliance=self.compliance
        )
        return replace(found, phase=self.phase, ground=self.ground)


def preloaded_contact(
    name: str, patch: Patch, first: ContactFace, second: ContactFace | None, normal: float | None = None,
    interference: float = 0.0, compliance: Array | None = None,
) -> Contact:  # fmt: skip
    """A contact pressed by a given normal force (N), or as near as an interference (m; negative: a gap) makes it.

    Under a given force the points carry what they carry in that state, moments included, and all of it counts as
    preload; an interference finds its balance with the bodies in the analysis itself.

    Args:
        compliance: see `Contact`; without it a patch that deforms is pressed in the shape that it was made with.

    Raises:
        UserError: a negative normal force, or one that the law does not reach.
    """
    from ..contact.patch import equilibrium, pressing
    from ..contact.set_valued import SetValued

    offset, preload = np.zeros(patch.count), np.zeros(patch.count)
    if normal is None:
        offset[0] = interference
    elif isinstance(patch.law, SetValued):  # evenly pressed; its points share it as the motion asks
        preload = patch.kinematics[:, 0].T @ np.full(len(patch.points), normal / len(patch.points))
    else:
        offset, preload[0] = equilibrium(patch, normal, compliance=compliance), normal
        preload[6:] = pressing(patch, offset)[6:]
    return Contact(name, patch, first, second, offset, preload, compliance=compliance)


@dataclass(frozen=True)
class Load:
    """A harmonic force on a component.

    Attributes:
        component. row: name of an excitation. amplitude: complex 0-peak number that multiplies the row, N for a unit
            force, Pa for a unit pressure. harmonic: of the base frequency; 0 for a steady load. tone: 1, or 2 where the
            base frequency is a second one, which only `two_tones` and a motion in time know.
    """

    component: str
    row: str
    amplitude: complex = 1.0
    harmonic: int = 1
    tone: int = 1

    def __post_init__(self) -> None:
        bounded(f"load on '{self.component}': amplitude", [complex(self.amplitude).real, complex(self.amplitude).imag])


@dataclass(frozen=True)
class Output:
    """A read-out of a component: a row of a monitor or a gauge."""

    component: str
    monitor: str
    label: str


@dataclass(frozen=True)
class Linear:
    """What is linear in one harmonic, of one component or of several together.

    Attributes:
        M, K, C: (m, m); C with the gyroscopic matrix. rows: (c, m) motion along the contact coordinates.
        residual: (c, c) static compliance along them that the coordinates leave out, m/N.
        load: (m,) amplitude of the generalised force. given: (c,) motion by the loads beside the coordinates, m.
        output: (w, m) all read-outs of the assembly in its order, zero where another component is read; those of
            several parts add up. output_residual: (w, c) and output_given: (w,) of them beside the coordinates.
        loss: (m, m) H of bodies with a loss factor, residual_loss: (c, c) S: a vibration meets the stiffness K + i H
            and the compliance residual - i S. None: nothing, as in the mean.
    """

    M: Array
    K: Array
    C: Array
    rows: Array
    residual: Array
    load: ComplexArray
    given: ComplexArray
    output: Array
    output_residual: Array
    output_given: ComplexArray
    loss: Array | None = None
    residual_loss: Array | None = None

    @property
    def stiff(self) -> Array:
        """(m, m) K + i H."""
        return self.K if self.loss is None else self.K + 1j * self.loss

    @property
    def yielding(self) -> Array:
        """(c, c) residual - i S."""
        return self.residual if self.residual_loss is None else self.residual - 1j * self.residual_loss

    def viscous(self, Omega: float) -> Array:
        """(m, m) C that takes as much in a vibration of Omega (rad/s) as C and H together."""
        return self.C if self.loss is None else self.C + self.loss / Omega

    @property
    def count(self) -> int:
        """Number of contact coordinates."""
        return len(self.rows)


@dataclass(frozen=True, eq=False, repr=False)
class Assembly:
    """Members, contacts, loads and read-outs.

    Attributes:
        components, contacts, loads, outputs. ring: if the components are one sector that stands for N, or N sectors.
        stuck_damping: ratios of the modes with sticking contacts, one for all or one a mode from the lowest, the last
            one for all that follow; None: what the components bring. flow: what it adds among the components of a
            whole ring. Both couple components, so that they are eliminated together.
    """

    components: tuple[Component, ...]
    contacts: tuple[Contact, ...]
    loads: tuple[Load, ...]
    outputs: tuple[Output, ...]
    ring: Ring | None = None
    stuck_damping: tuple[float, ...] | None = None
    flow: tuple[Flow, ...] = ()

    def __repr__(self) -> str:
        named = {
            "components": [m.name for m in self.components],
            "contacts": [c.name for c in self.contacts],
            "loads": [x.row for x in self.loads],
            "read-outs": [f"{w.monitor} {w.label}" for w in self.outputs],
        }
        said = "; ".join(f"{key} {', '.join(names)}" for key, names in named.items() if names)
        ring = f"; one of {self.ring.blades} sectors, engine order {self.ring.order}" if self.ring else ""
        return f"<Assembly: {said}{ring}>"

    @property
    def messages(self) -> tuple[str, ...]:
        """What a reader must know: nothing; of an assembly that a case describes see `Built.messages`."""
        return ()

    def check_names(self) -> None:
        """Raise `UserError` for a side, a load or a read-out of what is not there, or where there is no component; for
        a load of a second frequency, which who knows of it takes out before."""
        if any(x.tone != 1 for x in self.loads):
            raise UserError("loads: one has a second frequency (tone 2), which this analysis lacks; use two_tones")
        if not self.components:
            raise UserError("an assembly needs a component")
        has = {m.name: next(iter(m.groups.values())) for m in self.components}
        sides = [s for c in self.contacts for s in (c.first, c.second) if s]
        named = [("interface", s.component, s.interface, lambda g: g.interfaces) for s in sides if s.rows is None]
        named += [("load", x.component, x.row, lambda g: g.excitations) for x in self.loads]
        named += [("read-out", w.component, w.monitor, lambda g: {**g.monitors, **g.gauges}) for w in self.outputs]
        for what, component, row, known in named:
            if component not in has:
                raise UserError(
                    f"{what} '{row}': there is no component '{component}'; the assembly has {', '.join(has)}"
                )
            if row not in (rows := known(has[component])):
                raise UserError(f"{what} '{row}': '{component}' has none of this name, but {', '.join(rows) or 'none'}")

    def index(self, harmonic: int) -> int:
        """Index of the wave that the components move in, see `Ring.index`; 0 without a ring."""
        return self.ring.index(harmonic) if self.ring else 0

    @property
    def blades(self) -> int:
        return self.ring.blades if self.ring else 0

    def sides(self, component: str) -> list[tuple[int, int, ContactFace]]:
        """(contact, 0 for its first or 1 for its second side, side) of all sides of a component, by contact."""
        both = [(i, j, s) for i, c in enumerate(self.contacts) for j, s in enumerate((c.first, c.second)) if s]
        return [found for found in both if found[2].component == component]

    def part(self, component: Component, harmonic: int) -> Linear:
        """One component in one harmonic; its contact coordinates are the motions of its sides, one after the other."""
        index, at = self.index(harmonic), component.at(self.index(harmonic))
        sides = [s for _, _, s in self.sides(component.name)]
        loads = [x for x in self.loads if x.component == component.name and x.harmonic == harmonic]
        M, K, C = at.matrices
        K = K + at.circulatory
        m = len(M)
        T = [s.motion(at, index, self.blades) for s in sides]
        rows = np.vstack(T) if T else np.zeros((0, m))
        amplitudes = np.array([x.amplitude for x in loads], dtype=complex)
        f = sum((np.conj(at.excitation(x.row)) * x.amplitude for x in loads), np.zeros(m, dtype=complex))
        frames = [
            s.frame * s.phase(index, self.blades) if s.rows is None else np.zeros((len(t), 6))
            for s, t in zip(sides, T, strict=True)
        ]
        A = diagonal(frames)
        labels = [label for s in sides for label in s.labels]
        forced = [f"excitation:{x.row}:{at.group.excitations[x.row].labels[0]}" for x in loads]
        own = [w.component == component.name for w in self.outputs]
        seen = [f"monitor:{w.monitor}:{w.label}" if mine else "" for w, mine in zip(self.outputs, own, strict=True)]
        zero = np.zeros(m)
        output = np.array(
            [at.monitor(w.monitor, w.label) if mine else zero for w, mine in zip(self.outputs, own, strict=True)]
        ).reshape(-1, m)
        B = A @ at.residual(labels, labels) @ A.conj().T
        lost = (at.loss, component.residual_loss * B) if harmonic and at.loss is not None else (None, None)
        return Linear(
            M, K, C, rows, B, f, A @ (at.residual(labels, forced) @ amplitudes), output,
            at.residual(seen, labels) @ A.conj().T, at.residual(seen, forced) @ amplitudes, *lost,
        )  # fmt: skip

    def unrolled(self) -> Assembly:
        """All N sectors in place of the one that stands for them: bodies ``blade_0``, ``blade_1``, ..., or one ring of
        a cyclic body, whose faces and rows are then ``right@0``, ``right@1``, ...
        """
        if self.ring is None:
            return self
        N = self.ring.blades
        names = _Sectors(self.ring, frozenset(m.name for m in self.components if m.sectors > 1))
        return Assembly(
            _all_round(self.components, N),
            tuple(names.contact(c, j) for j in range(N) for c in self.contacts),
            tuple(names.load(x, j) for j in range(N) for x in self.loads),
            tuple(names.output(w, j) for j in range(N) for w in self.outputs),
            None,
            self._stuck_damping_all_round(),
            _flows(self.components, N),
        )

    def _stuck_damping_all_round(self) -> tuple[float, ...] | None:
        """Of the whole ring, in which every mode of the sector is as many as there are sectors.

        Raises:
            UserError: modes of different ratios that are not one after the other, whatever the nodal diameter.
        """
        given = self.stuck_damping
        if given is None or len(set(given)) == 1:
            return given
        assert self.ring is not None
        N, bare = self.ring.blades, replace(self, stuck_damping=None)
        waves = (replace(bare, ring=replace(self.ring, order=n)) for n in range(N // 2 + 1))
        square = np.array([stuck_modes(w.joined(1), w.stiffness)[0] for w in waves])
        for j, (own, following) in enumerate(pairwise(given[: square.shape[1]])):
            if own != following and square[:, j].max() >= square[:, j + 1].min():
                raise UserError(
                    f"damping_ratio: modes {j + 1} and {j + 2} of a sector have ratios of their own, and in the whole "
                    "ring they are not one after the other over the nodal diameters; give both the same, or keep the "
                    "sector"
                )
        return tuple(np.repeat(given, N).tolist())

    def joined(self, harmonic: int) -> Linear:
        """All components in one harmonic; the contact coordinates are the relative motions, contact by contact."""
        parts = [self.part(m, harmonic) for m in self.components]
        part = join(parts, self.signs)
        if self.flow:
            ends = np.cumsum([len(p.M) for p in parts])
            own = {m.name: np.arange(b - len(p.M), b) for m, p, b in zip(self.components, parts, ends, strict=True)}
            part = _flown(part, self.flow, own, harmonic)
        return part if self.stuck_damping is None else _damped(part, self.stiffness, self.stuck_damping)

    @property
    def stiffness(self) -> Array:
        """(relative, relative) of the sticking contacts, contact by contact."""
        return diagonal([c.stiffness for c in self.contacts])

    @cached_property
    def coordinates(self) -> list[tuple[int, int, int, int]]:
        """(contact, side, where its coordinates begin, how many) of all sides, component by component."""
        found, start = [], 0
        for component in self.components:
            for i, j, _ in self.sides(component.name):
                k = self.contacts[i].patch.count
                found.append((i, j, start, k))
                start += k
        return found

    @cached_property
    def signs(self) -> Array:
        """(relative, sides) first side less second side of every contact."""
        begins = np.cumsum([0, *(c.patch.count for c in self.contacts)])
        out = np.zeros((begins[-1], sum(k for *_, k in self.coordinates)))
        for i, j, start, k in self.coordinates:
            out[begins[i] : begins[i] + k, start : start + k] = np.eye(k) * (-1.0 if j else 1.0)
        return out


@dataclass(frozen=True)
class _Sectors:
    """What one sector holds, in sector j of its ring. cyclic: names of bodies that are a ring in one piece."""

    ring: Ring
    cyclic: frozenset[str]

    def body(self, name: str, j: int) -> str:
        return name if name in self.cyclic else f"{name}_{j % self.ring.blades}"

    def row(self, component: str, name: str, j: int) -> str:
        return f"{name}@{j % self.ring.blades}" if component in self.cyclic else name

    def side(self, s: ContactFace, j: int) -> ContactFace:
        at, rows = j + s.shift, s.rows
        if rows is not None and s.component in self.cyclic:
            rows = _rows_all_round(s, at, self.ring.blades)
        body, row = self.body(s.component, at), self.row(s.component, s.interface, at)
        return replace(s, component=body, interface=row, shift=0, rows=rows)

    def contact(self, c: Contact, j: int) -> Contact:
        second, N = self.side(c.second, j) if c.second else None, self.ring.blades
        phase = c.phase + 2 * np.pi * (j * self.ring.index(1) % N) / N
        return replace(c, name=f"{c.name}_{j}", first=self.side(c.first, j), second=second, phase=phase)

    def load(self, x: Load, j: int) -> Load:
        N = self.ring.blades
        turn = complex(np.exp(2j * np.pi * (j * self.ring.index(x.harmonic) % N) / N))
        row = self.row(x.component, x.row, j)
        return Load(self.body(x.component, j), row, x.amplitude * turn, x.harmonic, x.tone)

    def output(self, w: Output, j: int) -> Output:
        return Output(self.body(w.component, j), self.row(w.component, w.monitor, j), w.label)


def _all_round(components: Sequence[Component], blades: int) -> tuple[Component, ...]:
    """The components of every sector, sector by sector; a cyclic body once, as a whole ring."""
    rings = [whole(m) for m in components if m.sectors > 1]
    lone = [replace(m, aerodynamic={}) if _coupled(m) else m for m in components if m.sectors == 1]
    return (*rings, *(replace(m, name=f"{m.name}_{j}") for j in range(blades) for m in lone))


def _coupled(component: Component) -> bool:
    """Whether the flow adds something else to a lone blade in each wave, and so couples the blades of a ring."""
    return component.sectors == 1 and len(set(component.aerodynamic.values())) > 1


def _flows(components: Sequence[Component], N: int) -> tuple[Flow, ...]:
    """What the flow adds among the components of a whole ring."""
    lone = [through([replace(m, name=f"{m.name}_{j}") for j in range(N)], m.aerodynamic)
            for m in components if _coupled(m)]  # fmt: skip
    return (*lone, *(flow for m in components if m.sectors > 1 and (flow := directed(m)) is not None))


def _flown(part: Linear, flows: Sequence[Flow], own: Mapping[str, Indices], harmonic: int) -> Linear:
    """A joined part with what the flow adds. own: name -> coordinates of a component."""
    kind = np.result_type(part.K, *(f.K for f in flows), *(f.C for f in flows))
    K, C = part.K.astype(kind if harmonic else part.K.dtype), part.C.astype(kind)
    for f in flows:
        at = np.concatenate([own[name] for name in f.components])
        K[np.ix_(at, at)] += f.K if harmonic else f.K.real
        C[np.ix_(at, at)] += f.C
    return replace(part, K=K, C=C)


def _rows_all_round(side: ContactFace, sector: int, N: int) -> Mapping[int, Array]:
    """Rows of a patch that deforms on the coordinates of a whole ring.

    Raises:
        UserError: a wave is missing.
    """
    rows = side.rows or {}
    if missing := [k for k in range(N // 2 + 1) if k not in rows]:
        raise UserError(
            f"{side.component}:{side.interface}: a whole ring needs the patch's shapes in every wave; that of nodal "
            f"diameter {missing[0]} was not asked for"
        )
    return {0: spread([rows[k] for k in range(N // 2 + 1)], sector, N)}


def diagonal(blocks: Sequence[Array]) -> Array:
    """Matrices one after the other along the diagonal: SciPy's `block_diag` of a few takes three times as long."""
    out = np.zeros([sum(len(b) for b in blocks), sum(b.shape[1] for b in blocks)], np.result_type(float, *blocks))
    i = j = 0
    for b in blocks:
        rows, columns = b.shape
        out[i : i + rows, j : j + columns] = b
        i, j = i + rows, j + columns
    return out


def join(parts: Sequence[Linear], E: Array) -> Linear:
    """Several parts as one, their contact coordinates combined by E (c, all of theirs)."""
    residual = E @ diagonal([p.residual for p in parts]) @ E.T
    loss = S = None
    if any(p.loss is not None for p in parts):
        loss = diagonal([np.zeros_like(p.M) if p.loss is None else p.loss for p in parts])
        S = diagonal([0.0 * p.residual if p.residual_loss is None else p.residual_loss for p in parts])
        S = E @ S @ E.T
    return Linear(
        diagonal([p.M for p in parts]), diagonal([p.K for p in parts]), diagonal([p.C for p in parts]),
        E @ diagonal([p.rows for p in parts]), residual,
        np.concatenate([p.load for p in parts]), E @ np.concatenate([p.given for p in parts]),
        np.hstack([p.output for p in parts]), np.hstack([p.output_residual for p in parts]) @ E.T,
        np.sum([p.output_given for p in parts], axis=0), loss, S,
    )  # fmt: skip


def stuck_modes(part: Linear, stiffness: Array) -> tuple[Array, Array]:
    """Modes with contacts of a stiffness (c, c), damping and gyroscopic forces left out.

    Returns:
        (m,) omega^2 in (rad/s)^2, and (m, m) shapes as columns, phi^H M phi = 1.
    """
    k = stiffness @ np.linalg.inv(np.eye(part.count) + part.residual @ stiffness)
    K = part.K + part.rows.conj().T @ k @ part.rows
    return scipy.linalg.eigh(0.5 * (K + K.conj().T), part.M)


def _damped(part: Linear, stiffness: Array, ratios: Sequence[float]) -> Linear:
    """With damping ratios of the modes with sticking contacts, C = sum 2 D omega (M phi)(M phi)^H, besides C."""
    values, shapes = stuck_modes(part, stiffness)
    omega, P = np.sqrt(np.maximum(values, 0.0)), part.M @ shapes
    D = np.append(ratios, np.full(max(len(omega) - len(ratios), 0), ratios[-1]))[: len(omega)]
    return replace(part, C=part.C + (P * (2 * D * omega)) @ P.conj().T)


def across(first: Array, second: Array, offset: Array | None = None) -> Array:
    """(6, 6) six rows in the second face's frame to motions in the first face's frame.

    Args:
        first, second: (3, 3) rows n, t1, t2 of the two frames in common axes. offset: (3,) m, from the second face's
            origin to the first one's, in common axes: rotations move the place of the contact; zero if not given.
    """
    Q = first @ second.T
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = Q
    if offset is not None:
        r = first @ offset
        out[:3, 3:] = -np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]]) @ Q  # phi x r
    return out
