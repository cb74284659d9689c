"""The nouns of microslip: frozen dataclasses of plain arrays in SI units. No numerics live here.

Changing one is ``dataclasses.replace``. Conventions (frames, signs, orders) stand in ``docs/conventions.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from .errors import NotConverged as NotConverged
from .errors import UserError as UserError

Array = NDArray[Any]
"""Real numbers in double precision unless the docstring says otherwise."""

ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.signedinteger[Any]]

VOIGT = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Order of the six strain and stress components (Sextro Eqs. (2.2-17), (2.2-19); the same as VTK's)."""


@dataclass(frozen=True)
class Material:
    """Linear elastic material.

    Attributes:
        density: mass density, kg/m3.
        elasticity: (6, 6) Hooke matrix H of Sextro Eq. (2.2-18) in the order `VOIGT` with engineering shear,
            in body axes, Pa, at the reference temperature.
        expansion: (6,) thermal strain per kelvin in the same order (engineering shear), 1/K.
        temperature_table: (t, 2) temperature in K and the factor on `elasticity` at that temperature;
            linear between the entries, constant outside. ``None``: the modulus does not depend on temperature.
        name: for reports.
    """

    density: float
    elasticity: Array
    expansion: Array
    temperature_table: Array | None = None
    name: str = "material"

    def modulus_factor(self, temperature: Array) -> Array:
        """Factor on `elasticity` at the given temperatures (K), any shape."""
        if self.temperature_table is None:
            return np.ones_like(temperature)
        return np.interp(temperature, self.temperature_table[:, 0], self.temperature_table[:, 1])


@dataclass(frozen=True)
class Mesh:
    """A volume mesh with named faces.

    Attributes:
        points: (n, 3) reference positions, m.
        cells: cell type (meshio's names: ``tetra10``, ``hexahedron20``, ...) -> (e, k) point indices,
            0-based, in VTK's node order.
        faces: face name -> {facet type (``triangle6``, ``quad8``, ...): (f, k) point indices}; the facets are
            ordered so that their normal points out of the body.
        point_sets: set name -> point indices.
        node_id: (n,) numbers of the points in the file the mesh came from.
        materials: those the file brings, empty if it brings none. regions: cell type -> (e,) number of each cell's
            material, ascending; empty unless there are materials. temperature: (n, 2) of the stress-free and of the
            actual state as the file has them, in its own unit, or None. cell_id: cell type -> (e,) the file's numbers
            of the cells, or nothing.
        inner: name of a set of facets that cannot serve as a face -> (facets inside the volume, all of them).
        supports: point set -> directions that the file holds at zero, like ``xyz``. not_held: the file's constraints
            that are not among them, in words. unended: what the file lacks at its end, in words, or nothing.
    """

    points: Array
    cells: Mapping[str, Indices]
    faces: Mapping[str, Mapping[str, Indices]] = field(default_factory=dict)
    point_sets: Mapping[str, Indices] = field(default_factory=dict)
    node_id: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    materials: tuple[Material, ...] = ()
    regions: Mapping[str, Indices] = field(default_factory=dict)
    temperature: Array | None = None
    cell_id: Mapping[str, Indices] = field(default_factory=dict)
    inner: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    supports: Mapping[str, str] = field(default_factory=dict)
    not_held: tuple[str, ...] = ()
    unended: str = ""

    @property
    def n_points(self) -> int:
        return len(self.points)

    @property
    def n_cells(self) -> int:
        return sum(len(c) for c in self.cells.values())

    def face_points(self, name: str) -> Indices:
        """Sorted indices of the points on a face, or of a point set of that name."""
        if name in self.faces:
            return np.unique(np.concatenate([f.ravel() for f in self.faces[name].values()]))
        return np.unique(self.point_sets[name])


@dataclass(frozen=True)
class Matrices:
    """A body that another program has assembled: M x'' + (C + G) x' + K x = f, in SI.

    Attributes:
        stiffness, mass: (m, m) symmetric. damping: (m, m), gyroscopic: (m, m) skew, or None.
        mesh: the nodes, and cells and sets if they are known. node: (m,) point of each row, -1 for a generalised
            coordinate of a superelement. component: (m,) 0 to 2: displacement along x, y, z; 3 to 5: rotation about
            them; -1 for a generalised coordinate.
        grounded: whether the supports are in the matrices already. remarks: what the reader had to assume.
    """

    stiffness: csr_matrix
    mass: csr_matrix
    damping: csr_matrix | None
    gyroscopic: csr_matrix | None
    mesh: Mesh
    node: Indices
    component: Indices
    grounded: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.node)


INTERFACE_ROWS = ("u_n", "u_t1", "u_t2", "phi_n", "phi_t1", "phi_t2")


@dataclass(frozen=True)
class Interface:
    """One contact patch of a body and its six rows (Sextro Eqs. (5.1-6), (5.1-8)).

    Attributes:
        origin: (3,) area centre of the patch, m, body axes.
        rotation: (3, 3), rows n (outward normal of this body), t1, t2: ``x_interface = rotation @ x_body``.
        rows: (6, m) translations u_n, u_t1, u_t2 and rotations about the same axes, per unit of each
            generalised coordinate.
        fit_residual: (m,) 1: root-mean-square displacement of the patch that its best rigid motion leaves,
            over the root-mean-square displacement of the patch.
        points: (p, 3) quadrature points of the patch, m. areas: (p,) m2 (their sum is the area).
        normals: (p, 3) outward unit normals.
        shapes: (p, 3, m) displacement of the points, body axes. May be empty (0 points) if not stored.
        role: ``left``, ``right``, ``ground``, ``load`` or ``bolt``. partner: name of the facing interface.
        extent: (2,) b0 along t1 and h0 along t2, m (Sextro Fig. 5.1-3). polygon: (k, 3) corners of the convex
            outline seen along n, m, anticlockwise about n; empty for a face that closes on itself.
        sector_shift: +1 if the partner belongs to the next blade, -1 previous, 0 the same body or ground.
        characteristic: (c, m) amplitudes, m root-mean-square, of the patch's characteristic shapes, with
            pattern: (p, 3, c) what one of them moves the points by, body axes. Empty for a rigid patch.
    """

    origin: Array
    rotation: Array
    rows: Array
    fit_residual: Array
    points: Array
    areas: Array
    normals: Array
    shapes: Array
    role: str = "ground"
    partner: str = ""
    sector_shift: int = 0
    extent: Array = field(default_factory=lambda: np.zeros(2))
    polygon: Array = field(default_factory=lambda: np.zeros((0, 3)))
    characteristic: Array = field(default_factory=lambda: np.zeros((0, 0)))
    pattern: Array = field(default_factory=lambda: np.zeros((0, 3, 0)))

    def row(self, name: str) -> Array:
        """(m,) one of the rows by its label: ``u_n``, ..., ``phi_t2``, ``c1``, ``c2``, ...

        Raises:
            ValueError: there is no such row.
        """
        if name in INTERFACE_ROWS:
            return self.rows[INTERFACE_ROWS.index(name)]
        number = int(name.removeprefix("c"))
        if not 0 < number <= len(self.characteristic):
            raise ValueError(f"no characteristic coordinate {name}")
        return self.characteristic[number - 1]


@dataclass(frozen=True)
class StressSet:
    """Strain and stress of every generalised coordinate at a set of places (Sextro Eqs. (2.4-16), (2.4-17)).

    Attributes:
        location: ``gauss`` or ``nodal-averaged``.
        points: (s, 3) m. strain: (s, 6, m) engineering shear. stress: (s, 6, m) Pa per unit coordinate.
        static_stress: (s, 6) stress of the static state at speed, Pa (zeros without load).
        weights: (s,) volume that belongs to the place, m3.
    """

    location: str
    points: Array
    strain: Array
    stress: Array
    static_stress: Array
    weights: Array


CENTRIFUGAL = "rad2/s2"
"""Unit of excitations by the body's own centrifugal force: N per (rad/s)^2."""


@dataclass(frozen=True)
class Rows:
    """Named rows on the generalised coordinates: ``values = rows @ q`` for read-outs, ``rows.conj().T @ f`` for forces.

    Attributes:
        rows: (r, m). labels: r texts. unit: of one row times a unit coordinate's displacement.
        point: (3,) m, where it acts (mean point for distributed loads). distance: how far the point asked for
            was from the body, m (0 when inside).
        static: (r,) what the rows read in the static state at speed (zeros for force rows).
    """

    rows: Array
    labels: tuple[str, ...]
    unit: str
    point: Array
    distance: float = 0.0
    static: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Compliance:
    """Static compliance over ALL interface, load and monitor rows, and the part the kept modes hold.

    Attributes:
        labels: r texts ``interface:right:n``, ``excitation:...``, ``monitor:...``.
        static: (r, r) displacement of row i under a unit force on row j, full model (inertia relief, i.e. the
            elastic part about the rigid motion, when the body is free).
        modal: (r, r) sum of T_i T_j / omega^2 over the kept elastic modes.
        inertia_relief: True if the body is free.
        eigenmodes: (r, r) the part that the eigenmodes of the band hold alone, whatever the method added to or made
            of them; None where nothing but eigenmodes is kept, see `plain`.
    """

    labels: tuple[str, ...]
    static: Array
    modal: Array
    inertia_relief: bool
    eigenmodes: Array | None = None

    @property
    def plain(self) -> Array:
        """(r, r) what a basis of as many plain eigenmodes would hold: the book's reference."""
        return self.modal if self.eigenmodes is None else self.eigenmodes

    @property
    def residual(self) -> Array:
        """(r, r) what the modes leave out; to be added by a contact or a residual-flexibility method."""
        return self.static - self.modal


@dataclass(frozen=True)
class Residual:
    """What the modes leave out of the static answer to forces on interface and load rows (MacNeal).

    With coordinates q and forces f on the rows the displacement is ``group.phi @ q + phi @ f``; strain, stress and
    gauges alike.

    Attributes:
        labels: r texts, those of `Compliance.labels` that belong to interfaces and excitations.
        phi: (n, 3, r) m per unit force; may be empty. gauges: name -> (1, r) strain per unit force.
        strain, stress: stress set -> (s, 6, r), 1 and Pa per unit force.
    """

    labels: tuple[str, ...]
    phi: Array
    gauges: Mapping[str, Array]
    strain: Mapping[str, Array]
    stress: Mapping[str, Array]


@dataclass(frozen=True)
class GyroscopicModes:
    """Complex modes q = x exp(i omega t) of M_r q'' + G_r q' + K_r q = 0, in the frame that turns with the body.

    Attributes:
        omega: (w,) rad/s, ascending in magnitude. Of a real group positive, one a pair of conjugates; of a complex one
            all, a negative omega being the conjugate shape at |omega|. shapes: (m, w) complex, x^H M_r x = 1, in the
            coordinates of the group. growth: (w,) 1/s, zeros where stable.
        sense: (w,) between -1 and 1: mean sense of the orbits about the axis. direction: w texts ``forward`` (with
            the rotation), ``backward``, ``mixed``. error: (w,) bound of the relative error of omega against the
            unreduced body, NaN where none is known.
    """

    omega: Array
    shapes: ComplexArray
    growth: Array
    sense: Array
    direction: tuple[str, ...]
    error: Array

    @property
    def stable(self) -> bool:
        """True if no mode grows."""
        return not bool((self.growth > 0).any())

    @property
    def frequency(self) -> Array:
        """(w,) Hz, never negative."""
        return np.abs(self.omega) / (2 * np.pi)


@dataclass(frozen=True)
class RunUp:
    """What a change of the rotation speed adds, about the static state at the group's speed Omega_0.

    At speed Omega and angular acceleration alpha (Sextro Eqs. (2.1-17), (2.3-19)):

        M_r q'' + (C_r + 2 Omega N) q' + (K_r + (Omega_0^2 - Omega^2) P + alpha N) q
            = f + (Omega^2 - Omega_0^2) centrifugal + alpha euler

    Attributes:
        N: (m, m) phi^H M (n x phi), skew-Hermitian: circulatory per rad/s^2, and G_r = 2 Omega_0 N.
        P: (m, m) phi^H M (1 - n n^T) phi, Hermitian: spin softening per (rad/s)^2.
        euler: (m,) -phi^H M (n x r), load per rad/s^2. centrifugal: (m,) phi^H M (1 - n n^T) r, load per (rad/s)^2;
            r = x + u_static from the axis. Both vanish for nodal diameters other than 0.
    """

    N: Array
    P: Array
    euler: Array
    centrifugal: Array


MOTIONS = ("wxx", "wyy", "wzz", "wxy", "wyz", "wxz", "ax", "ay", "az", "bx", "by", "bz")
"""Rigid motions whose inertia forces stiffen a body: products of angular velocities, accelerations of the reference
point, angular accelerations."""


@dataclass(frozen=True)
class Invariants:
    """Inertia shape integrals about a reference point, in body axes, r = x + u_static from that point.

    Attributes:
        point: (3,) m. mass: kg. first_moment: (3,) integral of rho r. second_moment: (3, 3) of rho r_a r_b.
        shape: (3, m) of rho phi_a. position_shape: (3, 3, m) of rho r_a phi_b. shape_shape: (3, 3, m, m) of
            rho conj(phi_ai) phi_bj. So sum_a shape_shape[a, a] = M_r.
        stiffening: (12, m, m) stiffness per unit of each of `MOTIONS`, or (0, m, m) if it was not asked for.
    """

    point: Array
    mass: float
    first_moment: Array
    second_moment: Array
    shape: Array
    position_shape: Array
    shape_shape: Array
    stiffening: Array


@dataclass(frozen=True)
class ContactState:
    """Two faces in the static state at speed: how hard they press each other, where, and how near they are.

    Attributes:
        face, against, sector_shift: what may touch what. interface: name of the interface on `face`, or empty.
        normal_force: N, size of the resultant. force: (3,) N, on `face`, body axes. centre: (3,) m, of the pressure,
            in the reference geometry. points: (p, 3) m, areas: (p,) m2, quadrature points of the face, in the order of
            the interface's. pressure: (p,) Pa, areas @ pressure its integral. gap: (p,) m, the
            interference counted, negative where points overlap.
        closed_share: area in contact over the area of the face. penetration: m, largest mean one of a node.
        penalty: Pa/m, the largest used. interference: m. modes: ``open`` (the modes do not know the contact, its force
            is a dead load) or ``closed`` (they keep its stiffness along the normal).
    """

    face: str
    against: str
    sector_shift: int
    interface: str
    normal_force: float
    force: Array
    centre: Array
    points: Array
    areas: Array
    pressure: Array
    gap: Array
    closed_share: float
    penetration: float
    penalty: float
    interference: float
    modes: str = "open"


@dataclass(frozen=True)
class ModalGroup:
    """The reduced body at one rotation speed (and one nodal diameter).

    Of a cyclic sector at a nodal diameter 0 < k < N/2 everything that is linear in the shapes is complex (phi, rows,
    strain, stress, G_r, compliance); ``rows @ q`` reads and ``rows^H @ f`` loads. The right-hand neighbour moves as
    R u exp(+i k 2 pi / N), and the shapes are normalised on one sector: phi^H M phi = 1.

    Attributes:
        speed: rotation speed, rad/s.
        omega: (m,) angular eigenfrequencies, rad/s, ascending, with nothing on the interfaces; rigid modes are
            exactly 0.
        kind: m texts, see `reduction.problem.Reduced`.
        to_diagonal: (m, p) V with V^H M_r V = 1, V^H K_r V = diag(omega^2); None if M_r and K_r are diagonal. With
            it, `omega` and `damping_ratio` are those of the p modes V, and phi and all rows stand per coordinate.
            p < m where some coordinates have no mass or are forces.
        damping_ratio: (m,) or (p,) D_j of Sextro Eq. (2.4-13).
        M_r, K_r, C_r, G_r: (m, m) reduced matrices; G_r is skew, for the given speed (Eq. (2.3-29)).
        phi: (n, 3, m) shapes, kg^-1/2, in the mesh's point order. May be empty.
        interfaces, excitations, monitors, gauges: see the classes; gauge rows read strain.
        compliance: truncation check.
        stresses: location -> `StressSet`.
        u_static: (n, 3) static displacement at speed, m.
        checks: name -> number (orthogonality, backward error, certified count, ...).
        prestress: ``none``, ``linear`` or ``nonlinear``: how K was made. harmonic: nodal diameter.
        spin_softening: whether -Omega^2 M P is in K.
        run_up: what a change of the speed adds, or None. gyroscopic: modes with G_r, or None (at rest).
        invariants: inertia integrals for large rigid motion, or None (a cyclic sector).
        contacts: closures of the static state. residual: shapes and stresses beside the modes (``macneal``), or None.
    """

    speed: float
    omega: Array
    kind: tuple[str, ...]
    damping_ratio: Array
    M_r: Array
    K_r: Array
    C_r: Array
    G_r: Array
    phi: Array
    interfaces: Mapping[str, Interface]
    excitations: Mapping[str, Rows]
    monitors: Mapping[str, Rows]
    gauges: Mapping[str, Rows]
    compliance: Compliance
    stresses: Mapping[str, StressSet]
    u_static: Array
    checks: Mapping[str, float]
    prestress: str = "none"
    harmonic: int = 0
    spin_softening: bool = True
    to_diagonal: Array | None = None
    run_up: RunUp | None = None
    gyroscopic: GyroscopicModes | None = None
    invariants: Invariants | None = None
    contacts: Mapping[str, ContactState] = field(default_factory=dict)
    residual: Residual | None = None

    @property
    def frequency(self) -> Array:
        """(m,) Hz."""
        return self.omega / (2 * np.pi)

    @property
    def n_modes(self) -> int:
        """Number of generalised coordinates."""
        return len(self.kind)


@dataclass(frozen=True)
class SpeedRange:
    """The body at every speed of a range in one set of coordinates (of one nodal diameter).

    What depends on speed is the polynomial through the samples, entry by entry; G_r grows with Omega.

    Attributes:
        samples: s groups at rising speeds in the SAME c coordinates: M_r = 1, K_r the projected stiffness about the
            equilibrium there, to_diagonal the modes; phi and patch shapes are one array for all.
        solved: (s,) True where the modes were solved for (certified), False where only the equilibrium was.
        held: (s,) True for the h speeds held out: their K_r is compared, not used. All else of them is used.
        slopes: (s - h, c, c) dK_r/dOmega^2 at the samples not held out, or (0, c, c) where they are not needed.
        form: what of the stiffness is interpolated: ``stiffness`` K_r, or its ``root`` K_r^(1/2).
        shift: a of the variable sqrt(Omega^2 + a) of all polynomials, (rad/s)^2; None: the variable is Omega^2.
        count: modes kept in a group made from the range.
        lead: (k, c) read-outs that decide the basis of pairs; the first `signs` of them decide signs (0: phi does).
        interpolation_error, projection_error, total_error: (h,) largest relative frequency error of the kept modes at
            the held-out speeds.
        tolerance: that the total was held to. points: (p,) rad/s, speeds of the Campbell diagram.
        gyroscopic: whether groups made from the range have their gyroscopic modes.
    """

    samples: tuple[ModalGroup, ...]
    solved: Array
    held: Array
    slopes: Array
    form: str
    shift: float | None
    count: int
    lead: Array
    signs: int
    interpolation_error: Array
    projection_error: Array
    total_error: Array
    tolerance: float
    points: Array
    gyroscopic: bool = False

    @property
    def speeds(self) -> Array:
        """(s,) rad/s."""
        return np.array([g.speed for g in self.samples])

    @property
    def held_out(self) -> Array:
        """(h,) rad/s."""
        return self.speeds[self.held]


@dataclass(frozen=True)
class ModalBasis:
    """Everything a modal file holds: the body, its mesh, and a `ModalGroup` per speed (and nodal diameter).

    Attributes:
        name: of the body. mesh: in SI. groups: (speed index, nodal diameter) -> group.
        mass: kg. centre: (3,) m. inertia: (3, 3) kg m2 about the centre, body axes (Eqs. (2.3-32) to (2.3-34)).
        rotation_axis, rotation_point: (3,) unit vector and a point of the axis, m.
        damping_source: text that says where the ratios come from (``ratio``, ``rayleigh``, ``table``).
        free: True if rigid motions remain.
        reduction: name of the method.
        sectors: N; 1 for a body without cyclic symmetry. Then mass, centre and inertia are those of one sector.
        cyclic_faces: names of its left and right face in the mesh; right is left turned by 2 pi / N.
        ranges: nodal diameter -> the body over a range of speeds.
        provenance: name -> text (settings, hashes, versions); nothing that changes between identical runs.
        source: ``elements``: assembled on the mesh; ``matrices``: from foreign matrices (the mesh may have points
            alone); ``measured``: from a test.
    """

    name: str
    mesh: Mesh
    groups: Mapping[tuple[int, int], ModalGroup]
    mass: float
    centre: Array
    inertia: Array
    rotation_axis: Array
    rotation_point: Array
    damping_source: str
    free: bool
    reduction: str
    provenance: Mapping[str, str]
    sectors: int = 1
    cyclic_faces: tuple[str, str] = ("cyclic_left", "cyclic_right")
    ranges: Mapping[int, SpeedRange] = field(default_factory=dict)
    source: str = "elements"
