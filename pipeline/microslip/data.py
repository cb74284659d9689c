"""The nouns of microslip: frozen dataclasses of plain arrays in SI units. No numerics but `largest` live here.

Changing one is ``dataclasses.replace``. Conventions (frames, signs, orders) stand in ``docs/conventions.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from .errors import NotConverged as NotConverged
from .errors import UserError as UserError

Array = NDArray[Any]
"""Real numbers in double precision unless the docstring says otherwise."""

ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.signedinteger[Any]]
Flags = NDArray[np.bool_]


def largest(values: Array) -> float:
    """The largest size of the numbers of an array, 0 of none."""
    return float(np.abs(values).max(initial=0.0))


@dataclass(frozen=True)
class Stored:
    """How a field stands in a modal file; `files.declared` writes, reads and checks by it, and docs/ shows it.

    Attributes:
        over: names of its dimensions, ``node axis mode``; fields over the same name have the same length there. Empty:
            a number, or an attribute. unit: its attribute `unit`; ``@name``: what that field of the noun says.
        holds: in words. at: where, from the noun's group on: ``modes/omega``; ``@role``: an attribute; an absolute path
            for what all speeds share; ``<name>``: what the noun is called. Empty: the field's name.
        when: in which files it is, if not in all; an empty array or None is not written. finite: whether it must be.
        order: of writing, lower ones first, else as the fields stand. hertz: the frequency in Hz stands beside it.
        by: property that is written in its place.
    """

    over: str = ""
    unit: str = ""
    holds: str = ""
    at: str = ""
    when: str = ""
    finite: bool = True
    order: int = 0
    hertz: bool = False
    by: str = ""


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
        stiffness_table: temperatures (t,) in K and matrices (t, 6, 6) that take the place of
            `elasticity` where not only one factor changes, or ``None``.
        expansion_table: (t, 2) temperature in K and the factor on `expansion`, a secant from
            `zero`, K; linear between, constant outside. ``None``: it is constant.
    """

    density: float
    elasticity: Array
    expansion: Array
    temperature_table: Array | None = None
    name: str = "material"
    stiffness_table: tuple[Array, Array] | None = None
    expansion_table: Array | None = None
    zero: float = 0.0

    @property
    def softening(self) -> Array | None:
        """(t, 2) temperature in K and the factor on the first stiffness, None where it is constant."""
        if self.stiffness_table is None:
            return self.temperature_table
        T, C = self.stiffness_table
        return np.column_stack([T, C[:, 0, 0] / C[0, 0, 0]])

    def stiffness_at(self, temperature: Array) -> Array:
        """(..., 6, 6) Pa of `stiffness_table` at temperatures (K)."""
        assert self.stiffness_table is not None
        T, C = self.stiffness_table
        at = np.clip(np.interp(temperature, T, np.arange(len(T))), 0, len(T) - 1)
        low = np.minimum(at.astype(np.int64), max(len(T) - 2, 0))
        share = (at - low)[..., None, None]
        return (1 - share) * C[low] + share * C[np.minimum(low + 1, len(T) - 1)]

    def thermal_strain(self, temperature: Array, reference: Array) -> Array:
        """(..., 6) strain at temperatures (K) of what is free of strain at the reference ones."""
        if self.expansion_table is None:
            return (temperature - reference)[..., None] * self.expansion

        def grown(T: Array) -> Array:
            assert self.expansion_table is not None
            return np.interp(T, *self.expansion_table.T) * (T - self.zero)

        return (grown(temperature) - grown(reference))[..., None] * self.expansion

    def modulus_factor(self, temperature: Array) -> Array:
        """Factor on `elasticity` at the given temperatures (K), any shape."""
        if self.temperature_table is None:
            return np.ones_like(temperature)
        return np.interp(temperature, self.temperature_table[:, 0], self.temperature_table[:, 1])


@dataclass(frozen=True)
class Equation:
    """Sum of factors times displacements is zero. `where`: its place in the file, of every link.

    Attributes:
        nodes, directions, factors: (t,) of its terms; a node beyond the mesh's points is a reference node, directions 3
            to 5 are its rotations. first: whether it gives the displacement of the first term, or of any.
    """

    where: str
    nodes: Indices
    directions: Indices
    factors: Array
    first: bool = True


@dataclass(frozen=True)
class RigidLink:
    """Nodes that follow a reference node as a rigid body: u = u_r + theta_r x (x - x_r), in some directions.

    Attributes:
        reference: node. members: nodes, or the face that has them. directions: out of x, y, z, and of a, b, c
            for members that are reference nodes and turn with it. axes: (3, 3) rows x, y, z of the directions,
            None: those of the body.
    """

    where: str
    reference: int
    members: Indices | str
    directions: str = "xyz"
    axes: Array | None = None


@dataclass(frozen=True)
class AverageLink:
    """A reference node that follows nodes in the mean: the rigid motion that fits theirs best, by weights.

    Attributes:
        reference: node. members: nodes, or the face that has them. weights: (m,) of the members, (m, 3, 3) if in single
            directions; None: their tributary areas of the face. directions: which of the reference node's x, y, z and
            rotations a, b, c follow. axes: (3, 3) rows x, y, z of these, None: those of the body.
    """

    where: str
    reference: int
    members: Indices | str
    weights: Array | None
    directions: str = "xyzabc"
    axes: Array | None = None


@dataclass(frozen=True)
class FaceTie:
    """Nodes of one face that stay where they are on another one.

    Attributes:
        slave, master: face, the slave also a point set. tolerance: m; None: a twentieth of the master's facets.
    """

    where: str
    slave: str
    master: str
    tolerance: float | None = None


@dataclass(frozen=True)
class Guide:
    """Supports in skewed directions: of each node the displacement along an axis is zero.

    Attributes:
        nodes: (m,), a node as often as it has such axes. axes: (m, 3) unit vectors. turning: rotations of
            reference nodes about these axes are zero instead.
    """

    where: str
    nodes: Indices
    axes: Array
    turning: bool = False


Link = Equation | RigidLink | AverageLink | FaceTie | Guide


@dataclass(frozen=True)
class Links:
    """The constraints of a deck, and the nodes without cells that they refer to.

    Attributes:
        items: those of the deck. references: (k, 3) m, node n_points + j is the j-th. reference_id: (k,) numbers in
            the file. sets: name -> reference nodes, counted from 0.
    """

    items: tuple[Link, ...]
    references: Array
    reference_id: Indices
    sets: Mapping[str, Indices] = field(default_factory=dict)


@dataclass(frozen=True)
class PointMass:
    """A rigid body on a node. `where`: its place in the file.

    Attributes:
        node: that carries it. mass. offset: (3,) of its centre from the node. inertia: (3, 3) tensor
            about the centre; all in the units of the file.
    """

    where: str
    node: int
    mass: float
    offset: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True)
class LumpedElement:
    """A spring or dashpot: a small symmetric matrix over displacements and rotations of nodes.

    Attributes:
        nodes, directions: (t,) of its rows; directions 3 to 5 are rotations. stiffness, damping:
            (t, t), in the units of the file. along: stiffness of a spring along the line from the
            first node to the last, which turns with it; 0 of others.
    """

    where: str
    nodes: Indices
    directions: Indices
    stiffness: Array
    damping: Array
    along: float = 0.0


@dataclass(frozen=True)
class Lumps:
    """Point masses, springs and dashpots of a mesh, all of them as translations of its points.

    Inertia and rotational springs of a node stand on points that follow it rigidly.

    Attributes:
        points: (j,) with masses (j,), kg; those beside a principal axis of an impossible inertia
            may be negative. pairs: (m, 2) points a <= b. stiffness, damping: (m, 3, 3) what they
            add to the block of a and b, N/m and N s/m. lines: (s, 2) points a < b of springs along
            the lines between them, tight: (s,) N/m of these.
    """

    points: Indices
    masses: Array
    pairs: Indices
    stiffness: Array
    damping: Array
    lines: Indices
    tight: Array


@dataclass(frozen=True)
class Ties:
    """Linear equations C (u, q) = 0 between the displacements u of points and the motions q of reference nodes.

    Attributes:
        rows: (r, 3n + 6k) C; of a reference node three translations, m, then three rotations. dependent: (r,) column
            that a row gives, -1 where any may be chosen. of: (r,) number of the link that a row is of.
        told: what each link is and where it stands. otherwise: (links,) what becomes of a row whose dependent
            displacement something else gives: ``refuse``, ``leave out``, or give ``another``.
        references: (k, 3) m. numbers: (n + k,) of points and reference nodes in the file. sets: name -> reference
            nodes.
    """

    rows: csr_matrix
    dependent: Indices
    of: Indices
    told: tuple[str, ...]
    otherwise: tuple[str, ...]
    references: Array
    numbers: Indices
    sets: Mapping[str, Indices] = field(default_factory=dict)


@dataclass(frozen=True)
class Joint:
    """Two faces that a file lets touch. `where`: its place there. friction: the coefficient, None without one."""

    where: str
    slave: str
    master: str
    friction: float | None = None


@dataclass(frozen=True)
class Sector:
    """Cyclic symmetry as a file has it. `where`: its place there.

    Attributes:
        sectors: of the ring. faces: the two cut ones. axis: (3,) of the ring, of any length; point:
            (3,) on it, in the file's unit. diameters: nodal diameters that are asked for, or
            nothing.
    """

    where: str
    sectors: int
    faces: tuple[str, str]
    axis: tuple[float, ...]
    point: tuple[float, ...]
    diameters: tuple[int, ...] = ()


@dataclass(frozen=True)
class NodalLoad:
    """Forces on nodes, or displacements that are prescribed there. `where`: its place in the file, of every load.

    Attributes:
        kind: ``force`` (N, along rotations N m) or ``displacement`` (m, rad). nodes, directions, values: (t,) of its
            terms; nodes and directions as those of an `Equation`, along the axes of the body.
    """

    where: str
    kind: str
    nodes: Indices
    directions: Indices
    values: Array


@dataclass(frozen=True)
class FacetLoad:
    """A pressure that follows the surface, or a traction that keeps its direction.

    Attributes:
        facets: (f, c) corners as a file has them, (f, k) points of facets of the type `kind` in a mesh. values: (f,)
            or (f, c) at the corners, Pa; a pressure is positive into the body. direction: (3,) unit vector of a
            traction, None for a pressure. inside: whether it acts on facets between cells, too.
    """

    where: str
    facets: Indices
    values: Array
    direction: Array | None = None
    kind: str = ""
    inside: bool = False


@dataclass(frozen=True)
class BodyLoad:
    """A uniform acceleration field such as gravity: each mass m is pulled by m times it.

    Attributes:
        acceleration: (3,) m/s2. cells: (c,) the file's numbers of those that it acts on, in a mesh whether it acts on
            each, type by type; None: all.
    """

    where: str
    acceleration: Array
    cells: Indices | None = None


@dataclass(frozen=True)
class SpinLoad:
    """Centrifugal forces. speed: rad/s; axis: (3,) of any length; point: (3,) m of it; cells as of a `BodyLoad`."""

    where: str
    speed: float
    axis: Array
    point: Array
    cells: Indices | None = None


@dataclass(frozen=True)
class StaticStep:
    """What acts on a body in the static step that a file's modes are about; temperatures stand in `Mesh.temperature`.

    Attributes:
        where: place of the step. nonlinear: whether its displacements are finite (NLGEOM), else one linear solution.
        loads: all that act at its end, in a mesh in SI. supports: point set -> directions that it
            holds, as `Mesh.supports`; None: those of the modes.
    """

    where: str
    nonlinear: bool
    loads: tuple[NodalLoad | FacetLoad | BodyLoad | SpinLoad, ...] = ()
    supports: Mapping[str, str] | None = None


@dataclass(frozen=True, eq=False)
class Mesh:
    """A volume mesh with named faces.

    Attributes:
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
        lost: what carries mass, stiffness or a constraint in the file and is not read, in words.
        remarks: what of the file is read as something else or not used, in words. instances: name -> points.
        joints: faces that the file lets touch. sector: of a cyclic ring, if the file is one.
            preloads: of its bolts: where it stands, force in the file's unit.
        links: constraints of the file, and ties: the equations that `fem.links.linked` makes of them, or None.
        retained: point sets whose displacements a reduction of the file keeps.
        hanging: elements left out that share nodes with the solids or their constraints, in words, or nothing.
        lumps: point masses, springs and dashpots, or None; their points need not be of cells.
        state: the static step that the file's modes are about, or None. integration: rule of its bricks of 20 nodes,
            as `mesh.integration` of a body file.
    """

    points: Annotated[Array, Stored("node axis", "m", "reference positions", at="xyz")]
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
    lost: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    instances: Mapping[str, Indices] = field(default_factory=dict)
    joints: tuple[Joint, ...] = ()
    sector: Sector | None = None
    preloads: tuple[tuple[str, float], ...] = ()
    links: Links | None = None
    ties: Ties | None = None
    lumps: Lumps | None = None
    hanging: str = ""
    retained: tuple[str, ...] = ()
    state: StaticStep | None = None
    integration: str = "full"

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

    def set_points(self, name: str) -> Indices:
        """Sorted indices of all points of a set, those beside its whole facets too, or of a face of that name."""
        return np.unique(self.point_sets[name]) if name in self.point_sets else self.face_points(name)


@dataclass(frozen=True)
class MatrixTerm:
    """A matrix that scales with a parameter: factor (value / reference)^power times it is added to those of its role.

    Attributes:
        role: ``stiffness``, ``mass``, ``damping``, ``gyroscopic`` or ``circulatory``. matrix: (m, m), sparse or dense,
            SI, as symmetric as its role says. parameter: its name; ``speed`` is the speed of rotation, rad/s.
    """

    role: str
    matrix: Any
    parameter: str = "speed"
    power: float = 0.0
    factor: float = 1.0
    reference: float = 1.0


@dataclass(frozen=True)
class Matrices:
    """A body that another program has assembled: M x'' + (C + G) x' + (K + N) x = f, in SI.

    Attributes:
        stiffness, mass: (m, m) symmetric. damping: (m, m), gyroscopic: (m, m) skew, circulatory: (m, m), or None.
        mesh: the nodes, and cells and sets if they are known. node: (m,) point of each row, -1 for a generalised
            coordinate of a superelement. component: (m,) 0 to 2: displacement along x, y, z; 3 to 5: rotation about
            them; -1 for a generalised coordinate.
        grounded: whether the supports are in the matrices already. messages: what the reader had to assume.
        terms: what is added at the value of a parameter.
    """

    stiffness: csr_matrix
    mass: csr_matrix
    damping: csr_matrix | None
    gyroscopic: csr_matrix | None
    mesh: Mesh
    node: Indices
    component: Indices
    grounded: bool = False
    messages: tuple[str, ...] = ()
    circulatory: csr_matrix | None = None
    terms: tuple[MatrixTerm, ...] = ()

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.node)


INTERFACE_ROWS = ("u_n", "u_t1", "u_t2", "phi_n", "phi_t1", "phi_t2")
_FRAME = "/interfaces/<name>"


@dataclass(frozen=True)
class Interface:
    """One contact patch of a body and its six rows (Sextro Eqs. (5.1-6), (5.1-8)).

    Rows and amplitudes are per unit of each generalised coordinate; ``x_interface = rotation @ x_body``.
    """

    origin: Annotated[Array, Stored("axis", "m", "area centre of the patch, body axes", at=f"{_FRAME}/origin")]
    rotation: Annotated[Array, Stored(
        "frame_axis axis", "1", "rows n (outward normal of this body), t1, t2", at=f"{_FRAME}/rotation"
    )]  # fmt: skip
    rows: Annotated[Array, Stored(
        "interface_row mode", "kg^-1/2; last three m^-1 kg^-1/2", "u_n u_t1 u_t2 phi_n phi_t1 phi_t2", at="T"
    )]  # fmt: skip
    fit_residual: Annotated[Array, Stored(
        "mode", "1", "root-mean-square motion of the patch that its best rigid motion leaves, over that of the patch"
    )]  # fmt: skip
    points: Annotated[Array, Stored("point axis", "m", "quadrature points", at=f"{_FRAME}/patch/points", order=1)]
    areas: Annotated[Array, Stored("point", "m^2", "their sum is the patch's", at=f"{_FRAME}/patch/areas", order=1)]
    normals: Annotated[Array, Stored("point axis", "1", "outward", at=f"{_FRAME}/patch/normals", order=1)]
    shapes: Annotated[Array, Stored(
        "point axis mode", "kg^-1/2", "displacement of the points, body axes", at="patch/shapes",
        when="`output.patch_shapes`", order=1,
    )]  # fmt: skip
    role: Annotated[str, Stored(holds="`left`, `right`, `ground`, `load`, `bolt`", at=f"{_FRAME}@role", order=-1)] = (
        "ground"
    )
    partner: Annotated[str, Stored(holds="name of the facing interface", at=f"{_FRAME}@partner", order=-1)] = ""
    sector_shift: Annotated[int, Stored(
        holds="+1: the partner belongs to the next blade, -1: previous, 0: the same body or ground",
        at=f"{_FRAME}@sector_shift", order=-1,
    )] = 0  # fmt: skip
    extent: Annotated[Array, Stored(
        "", "m", "extents along t1 and t2 (Sextro Fig. 5.1-3)", at=f"{_FRAME}/patch@b0,h0"
    )] = field(default_factory=lambda: np.zeros(2))  # fmt: skip
    polygon: Annotated[Array, Stored(
        "corner axis", "m", "corners of the convex outline seen along n, anticlockwise about n",
        at=f"{_FRAME}/patch/polygon", when="the face does not close on itself",
    )] = field(default_factory=lambda: np.zeros((0, 3)))  # fmt: skip
    characteristic: Annotated[Array, Stored(
        "shape mode", "kg^-1/2", "amplitudes, m root mean square, of the characteristic shapes; compliance rows "
        "`interface:<name>:c1`, ...", when='`coordinates = "characteristic"`',
    )] = field(default_factory=lambda: np.zeros((0, 0)))  # fmt: skip
    pattern: Annotated[Array, Stored(
        "point axis shape", "1", "what one unit (m, root mean square) of each shape moves the points by, body axes",
        at=f"{_FRAME}/patch/pattern", when='`coordinates = "characteristic"`', order=1,
    )] = field(default_factory=lambda: np.zeros((0, 3, 0)))  # fmt: skip

    @property
    def held_share(self) -> float:
        """Share of the patch's area that no coordinate of its body moves: supports hold it."""
        if not len(self.shapes):
            return 0.0 if self.rows.any() or self.characteristic.any() else 1.0
        still = ~self.shapes.any(axis=(1, 2))
        return 1.0 if still.all() else float(self.areas[still].sum() / self.areas.sum())

    @property
    def area(self) -> float:
        """m2, of the patch."""
        return float(self.areas.sum())

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
    """Strain and stress of every generalised coordinate at a set of places (Sextro Eqs. (2.4-16), (2.4-17))."""

    location: Annotated[str, Stored(holds="`gauss` or `nodal-averaged`", at="stress/<name>@location")]
    points: Annotated[Array, Stored("place axis", "m", "the places, also in `strain`", at="stress/<name>/points")]
    strain: Annotated[Array, Stored("place component mode", "m^-1 kg^-1/2", "engineering shear", at="strain/<name>/T")]
    stress: Annotated[Array, Stored(
        "place component mode", "Pa m^-1 kg^-1/2", "per unit coordinate", at="stress/<name>/T"
    )]  # fmt: skip
    static_stress: Annotated[Array, Stored(
        "place component", "Pa", "stress of the static state at speed", at="rotation/sigma_static/<name>"
    )]  # fmt: skip
    weights: Annotated[Array, Stored("place", "m^3", "volume that belongs to the place", at="stress/<name>/weights")]
    singular: Annotated[Flags, Stored(
        "place", "", "1 in the zone of a support, a contact's edge or a sharp inner edge, where stress is the mesh's, "
        "see [results](results.md#where-not-to-look)", at="stress/<name>/singular", when="microslip writes it",
    )] = field(default_factory=lambda: np.zeros(0, dtype=bool))  # fmt: skip


CENTRIFUGAL = "rad2/s2"
"""Unit of excitations by the body's own centrifugal force: N per (rad/s)^2."""


@dataclass(frozen=True)
class Rows:
    """Named rows on the coordinates: ``values = rows @ q`` for read-outs, ``rows.conj().T @ f`` for forces."""

    rows: Annotated[Array, Stored("row mode", "", "strain gauges read strain", at="T", order=1)]
    labels: Annotated[tuple[str, ...], Stored("row", "", "names of the rows", at="row")]
    unit: Annotated[str, Stored(holds="of one row times a unit coordinate's displacement", at="@unit", order=-1)]
    point: Annotated[Array, Stored("axis", "m", "where it acts (mean point for distributed loads)")]
    distance: Annotated[
        float, Stored("", "m", "from the point asked for, 0 when inside the body", at="@distance", order=-1)
    ] = 0.0
    static: Annotated[Array, Stored(
        "row", "@unit", "what the rows read in the static state at speed (zeros for loads)"
    )] = field(default_factory=lambda: np.zeros(0))  # fmt: skip


_COMPLIANCE = ("compliance_row compliance_row", "displacement of the row per unit force of the column, SI")


@dataclass(frozen=True)
class Compliance:
    """Static compliance over ALL interface, load and monitor rows, and the part the kept modes hold."""

    labels: Annotated[tuple[str, ...], Stored(
        "compliance_row", "", "`interface:right:u_n`, `excitation:...`, `monitor:...`", at="compliance_row"
    )]  # fmt: skip
    static: Annotated[Array, Stored(
        *_COMPLIANCE, "displacement of row i under a unit force on row j, full model (the elastic part about the rigid "
        "motion when the body is free)", at="compliance_static",
    )]  # fmt: skip
    modal: Annotated[Array, Stored(
        *_COMPLIANCE, "sum of T_i T_j / omega^2 over the kept elastic modes", at="compliance_modal"
    )]  # fmt: skip
    inertia_relief: Annotated[bool, Stored(holds="1: the body is free", at="compliance_static@inertia_relief", order=1)]
    eigenmodes: Annotated[Array | None, Stored(
        *_COMPLIANCE, "what the eigenmodes of the band hold alone, equal to modal where nothing else is kept (see "
        "[compliance counted once](reduction.md#compliance-counted-once))", at="compliance_plain", by="plain",
    )] = None  # fmt: skip

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
        gauges: name -> (1, r) strain per unit force. strain, stress: stress set -> (s, 6, r), 1 and Pa per unit force.
    """

    labels: Annotated[tuple[str, ...], Stored(
        "force", "", "those of `compliance_row` that belong to interfaces and excitations", at="force"
    )]  # fmt: skip
    phi: Annotated[Array, Stored(
        "node axis force", "m per unit force", "what the modes leave of the static answer to a unit force on each row: "
        "displacement phi q + residual phi f, see [MacNeal](reduction.md#for-the-program-that-reads-the-file)",
        when="`output.shapes`",
    )]  # fmt: skip
    gauges: Mapping[str, Array]
    strain: Mapping[str, Array]
    stress: Mapping[str, Array]


@dataclass(frozen=True)
class GyroscopicModes:
    """Complex modes q = x exp(i omega t) of M_r q'' + G_r q' + K_r q = 0, in the frame that turns with the body."""

    omega: Annotated[Array, Stored(
        "whirl", "rad/s", "ascending in magnitude. Of a real group positive, one a pair of conjugates; of a complex "
        "one all, a negative omega being the conjugate wave at its magnitude", hertz=True,
    )]  # fmt: skip
    shapes: Annotated[ComplexArray, Stored(
        "mode whirl", "1", "complex (`shapes`, `shapes_imag`), shapes^H M_r shapes = 1, in the group's coordinates",
        order=1,
    )]  # fmt: skip
    growth: Annotated[Array, Stored("whirl", "s^-1", "growth rate, 0 where stable")]
    sense: Annotated[
        Array, Stored("whirl", "1", "mean sense of the orbits about the axis, 1 = circles with the rotation")
    ]
    direction: Annotated[tuple[str, ...], Stored("whirl", "", "`forward` (with the rotation), `backward`, `mixed`")]
    error: Annotated[Array, Stored(
        "whirl", "1", "bound of the relative error of omega against the unreduced body, NaN where none is known",
        finite=False,
    )]  # fmt: skip

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

    r = x + u_static from the axis; the loads vanish for nodal diameters other than 0.
    """

    N: Annotated[Array, Stored(
        "mode mode", "1", "phi^H M (n x phi), skew-Hermitian: circulatory per rad/s^2, and G_r = 2 Omega N"
    )]  # fmt: skip
    P: Annotated[Array, Stored(
        "mode mode", "1", "phi^H M (1 - n n^T) phi, Hermitian: spin softening is -Omega^2 P, see "
        "[rotation](rotation.md#run-up)",
    )]  # fmt: skip
    euler: Annotated[Array, Stored("mode", "kg^1/2 m", "-phi^H M (n x r), load per rad/s^2 of angular acceleration")]
    centrifugal: Annotated[Array, Stored("mode", "kg^1/2 m", "phi^H M (1 - n n^T) r, load per (rad/s)^2 of Omega^2")]


MOTIONS = ("wxx", "wyy", "wzz", "wxy", "wyz", "wxz", "ax", "ay", "az", "bx", "by", "bz")
"""Rigid motions whose inertia forces stiffen a body: products of angular velocities, accelerations of the reference
point, angular accelerations."""


@dataclass(frozen=True)
class Invariants:
    """Inertia shape integrals about a reference point, in body axes, r = x + u_static from that point.

    So sum_a shape_shape[a, a] = M_r.
    """

    point: Annotated[Array, Stored("axis", "m", "reference point, on the axis of rotation")]
    mass: Annotated[float, Stored("", "kg", "of the body")]
    first_moment: Annotated[Array, Stored("axis", "kg m", "integral of rho r_a")]
    second_moment: Annotated[Array, Stored("axis axis", "kg m^2", "of rho r_a r_b")]
    shape: Annotated[Array, Stored("axis mode", "kg^1/2", "of rho phi_a")]
    position_shape: Annotated[Array, Stored("axis axis mode", "kg^1/2 m", "of rho r_a phi_b")]
    shape_shape: Annotated[Array, Stored("axis axis mode mode", "1", "of rho conj(phi_ai) phi_bj")]
    stiffening: Annotated[Array, Stored(
        "motion mode mode", "per unit of the motion", "geometric stiffness per unit of the rigid motions in `@motions` "
        "(products of angular velocities, accelerations of the point, angular accelerations)",
        when="`output.stiffening`",
    )]  # fmt: skip


@dataclass(frozen=True)
class ContactState:
    """Two faces in the static state at speed: how hard they press each other, where, and how near they are.

    Points and areas are those of the face, in the order of the interface's.
    """

    face: Annotated[str, Stored(holds="what may touch", at="@face")]
    against: Annotated[str, Stored(holds="what it may touch", at="@against")]
    interface: Annotated[str, Stored(holds="name of the interface on the face, or empty", at="@interface")]
    modes: Annotated[str, Stored(
        holds="`open`: K_r does not know the contact, its force is a dead load; `closed`: K_r keeps its stiffness "
        "along the normal", at="@modes",
    )]  # fmt: skip
    sector_shift: Annotated[int, Stored(holds="as of an interface", at="@sector_shift")]
    normal_force: Annotated[float, Stored("", "N", "size of the resultant")]
    closed_share: Annotated[float, Stored("", "1", "area in contact over the area of the face")]
    penetration: Annotated[float, Stored("", "m", "largest mean one of a node")]
    penalty: Annotated[float, Stored("", "Pa/m", "the largest used")]
    interference: Annotated[float, Stored("", "m", "from the settings")]
    force: Annotated[Array, Stored("axis", "N", "on the face, body axes")]
    centre: Annotated[Array, Stored("axis", "m", "of the pressure, in the reference geometry")]
    points: Annotated[Array, Stored("point axis", "m", "quadrature points of the face")]
    pressure: Annotated[Array, Stored("point", "Pa", "areas @ pressure is its integral")]
    gap: Annotated[Array, Stored("point", "m", "the interference counted, negative where points overlap")]
    areas: Annotated[Array, Stored("point", "m^2", "of the points")]
    spread: Annotated[Array | None, Stored(
        "axis axis", "m^2", "second moment of the pressure about its centre, over the force; in the reference geometry",
        when="something touches",
    )] = None  # fmt: skip


@dataclass(frozen=True, repr=False)
class ModalGroup:
    """The reduced body at one rotation speed (and one nodal diameter).

    Of a cyclic sector at a nodal diameter 0 < k < N/2 everything that is linear in the shapes is complex (phi, rows,
    strain, stress, G_r, compliance); ``rows @ q`` reads and ``rows^H @ f`` loads. The right-hand neighbour moves as
    R u exp(+i k 2 pi / N), and the shapes are normalised on one sector: phi^H M phi = 1.

    Attributes:
        speed: rotation speed, rad/s.
        interfaces, excitations, monitors, gauges: see the classes; gauge rows read strain.
        compliance: truncation check.
        stresses: location -> `StressSet`.
        checks: name -> number (orthogonality, backward error, certified count, ...).
        prestress: ``none``, ``linear`` or ``nonlinear``: how K was made. harmonic: nodal diameter.
        spin_softening: whether -Omega^2 M P is in K.
        run_up: what a change of the speed adds, or None. gyroscopic: modes with G_r, or None (at rest).
        invariants: inertia integrals for large rigid motion, or None (a cyclic sector).
        contacts: closures of the static state. residual: shapes and stresses beside the modes (``macneal``), or None.
    """

    speed: float
    omega: Annotated[Array, Stored(
        "own_mode", "rad/s", "angular eigenfrequencies, ascending, with nothing on the interfaces; rigid modes are "
        "exactly 0", at="modes/omega", hertz=True,
    )]  # fmt: skip
    kind: Annotated[tuple[str, ...], Stored(
        "mode", "", "`rigid`, `normal`, and what other [reductions](reduction.md) add", at="modes/kind", order=1
    )]  # fmt: skip
    damping_ratio: Annotated[Array, Stored("own_mode", "1", "D_j of Sextro Eq. (2.4-13)", at="modes/damping_ratio")]
    M_r: Annotated[Array, Stored("mode mode", "1", "reduced mass", at="modes/M_r", order=1)]
    K_r: Annotated[Array, Stored(
        "mode mode", "s^-2", "stiffness; V^H K_r V is diag(omega^2), and of a free body at speed what its rigid "
        "motions (omega = 0) meet stands in their rows and columns: -Omega^2 across the axis", at="modes/K_r", order=1,
    )]  # fmt: skip
    C_r: Annotated[Array, Stored("mode mode", "s^-1", "damping", at="modes/C_r", order=1)]
    G_r: Annotated[Array, Stored(
        "mode mode", "s^-1", "gyroscopic at this speed, skew (Sextro Eq. (2.3-29))", at="modes/G_r", order=1
    )]  # fmt: skip
    phi: Annotated[Array, Stored(
        "node axis mode", "kg^-1/2", "shapes, in the order of `/mesh/node`", at="modes/phi", when="`output.shapes`",
        order=2,
    )]  # fmt: skip
    interfaces: Mapping[str, Interface]
    excitations: Mapping[str, Rows]
    monitors: Mapping[str, Rows]
    gauges: Mapping[str, Rows]
    compliance: Compliance
    stresses: Mapping[str, StressSet]
    u_static: Annotated[Array, Stored("node axis", "m", "static displacement at speed", at="rotation/u_static")]
    checks: Mapping[str, float]
    prestress: str = "none"
    harmonic: int = 0
    spin_softening: bool = True
    to_diagonal: Annotated[Array | None, Stored(
        "mode own_mode", "1", "V with V^H M_r V = 1, V^H K_r V as K_r says; omega and damping_ratio are those of "
        "V, phi and all rows stand per coordinate. Fewer modes than coordinates (axis `own_mode`) where some have no "
        "mass (`massless-interface`) or are forces (`interface-force`)",
        at="modes/to_diagonal", when="M_r or K_r is not diagonal", order=1,
    )] = None  # fmt: skip
    run_up: RunUp | None = None
    gyroscopic: GyroscopicModes | None = None
    invariants: Invariants | None = None
    contacts: Mapping[str, ContactState] = field(default_factory=dict)
    residual: Residual | None = None
    N_r: Annotated[Array | None, Stored(
        "mode mode", "s^-2", "circulatory: what the stiffness K_r + N_r holds beside the symmetric K_r, of which the "
        "modes are; of any symmetry", at="modes/N_r", when="the stiffness is not symmetric: friction, follower forces",
        order=1,
    )] = None  # fmt: skip

    @property
    def frequency(self) -> Array:
        """(m,) Hz."""
        return self.omega / (2 * np.pi)

    @property
    def n_modes(self) -> int:
        """Number of generalised coordinates."""
        return len(self.kind)

    def __repr__(self) -> str:
        return f"<ModalGroup: {self.n_modes} coordinates at {self.speed:.6g} rad/s, nodal diameter {self.harmonic}>"


@dataclass(frozen=True)
class SpeedRange:
    """The body at every speed of a range in one set of coordinates (of one nodal diameter).

    What depends on speed is the polynomial through the samples, entry by entry; G_r grows with Omega.

    Attributes:
        samples: groups at rising speeds in the SAME coordinates: M_r = 1, K_r the projected stiffness about the
            equilibrium there, to_diagonal the modes; phi and patch shapes are one array for all.
    """

    samples: tuple[ModalGroup, ...]
    form: Annotated[str, Stored(
        holds="how K_r is interpolated, see [speeds](speeds.md#reading-it-elsewhere): `root` K_r^(1/2) or `stiffness` "
        "K_r as a polynomial", at="@form",
    )]  # fmt: skip
    count: Annotated[int, Stored(holds="modes kept in a group made from the range", at="@count")]
    signs: Annotated[int, Stored(holds="how many of the first rows of `lead` decide signs (0: phi does)", at="@signs")]
    shift: Annotated[float | None, Stored(
        "", "(rad/s)^2", "a of the variable sqrt(Omega^2 + a) of all polynomials; NaN: the variable is Omega^2",
        at="@shift",
    )]  # fmt: skip
    tolerance: Annotated[float, Stored("", "1", "that the total error was held to", at="@tolerance")]
    gyroscopic: Annotated[bool, Stored(
        holds="whether groups made from the range have their gyroscopic modes", at="@gyroscopic"
    )]  # fmt: skip
    solved: Annotated[Flags, Stored(
        "sample", "", "1 where the modes were solved for and certified, or refined and counted complete"
    )]  # fmt: skip
    held: Annotated[Flags, Stored(
        "sample", "", "1 where the speed was held out: its K_r is compared, not used; all else of it is"
    )]  # fmt: skip
    slopes: Annotated[Array, Stored(
        "used mode mode", "1", "dK_r/dOmega^2 at the samples not held out, or of length 0 where they are not needed"
    )]  # fmt: skip
    lead: Annotated[Array, Stored("lead mode", "", "read-outs that decide the basis of pairs")]
    points: Annotated[Array, Stored("point", "rad/s", "speeds of the Campbell diagram")]
    interpolation_error: Annotated[Array, Stored(
        "held_out", "1", "largest relative frequency error of the kept modes at the held-out speeds, of the polynomials"
    )]  # fmt: skip
    projection_error: Annotated[Array, Stored("held_out", "1", "the same of the common coordinates")]
    total_error: Annotated[Array, Stored("held_out", "1", "of both")]

    @property
    def speeds(self) -> Array:
        """(s,) rad/s."""
        return np.array([g.speed for g in self.samples])

    @property
    def held_out(self) -> Array:
        """(h,) rad/s."""
        return self.speeds[self.held]


@dataclass(frozen=True, repr=False)
class ModalBasis:
    """Everything a modal file holds: the body, its mesh, and a `ModalGroup` per speed (and nodal diameter).

    Attributes:
        name: of the body. mesh: in SI. groups: (speed index, nodal diameter) -> group.
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
    mass: Annotated[float, Stored("", "kg", "0: not known (`source` = `measured`)", at="body/mass")]
    centre: Annotated[Array, Stored("axis", "m", "centre of mass", at="body/centre")]
    inertia: Annotated[Array, Stored(
        "axis axis", "kg m^2", "about the centre, body axes (Sextro Eqs. (2.3-32) to (2.3-34))", at="body/inertia"
    )]  # fmt: skip
    rotation_axis: Annotated[Array, Stored("axis", "1", "axis of rotation, unit vector", at="rotation/direction")]
    rotation_point: Annotated[Array, Stored("axis", "m", "a point of the axis", at="rotation/point")]
    damping_source: str
    free: bool
    reduction: str
    provenance: Mapping[str, str]
    sectors: int = 1
    cyclic_faces: tuple[str, str] = ("cyclic_left", "cyclic_right")
    ranges: Mapping[int, SpeedRange] = field(default_factory=dict)
    source: str = "elements"

    def to_dataframe(self) -> Any:
        """A `pandas.DataFrame` of all modes: speed (rad/s), nodal diameter, mode from 1, frequency (Hz), damping ratio,
        kind."""
        import pandas

        rows = [
            (g.speed, nd, i, *of_mode)
            for (_, nd), g in sorted(self.groups.items())
            for i, of_mode in enumerate(zip(g.frequency, g.damping_ratio, g.kind, strict=False), 1)
        ]
        heads = ["speed_rad_s", "nodal_diameter", "mode", "frequency_Hz", "damping_ratio", "kind"]
        return pandas.DataFrame(rows, columns=heads)

    def __repr__(self) -> str:
        speeds, diameters = (len({key[i] for key in self.groups}) for i in (0, 1))
        g = next(iter(self.groups.values()))
        named = {"interfaces": g.interfaces, "excitations": g.excitations, "monitors": g.monitors, "gauges": g.gauges}
        said = "; ".join(f"{key} {', '.join(names)}" for key, names in named.items() if names)
        elastic = g.frequency[g.omega > 0]
        over = f" from {elastic[0]:.6g} to {elastic[-1]:.6g} Hz" if len(elastic) else ""
        of = f"{speeds} speed{'s' * (speeds > 1)}" + (f", {diameters} nodal diameters" if self.sectors > 1 else "")
        return f"<ModalBasis {self.name}: {g.n_modes} coordinates{over}, {self.reduction}, {of}; {said}>"
