"""body.toml: what a person may write about one body, checked, with every mistake named by its key.

`load_body` returns the settings in SI: every length of the file, given in `length_unit`, has become metres. The
build and CAD meshers are handed the file's own numbers (`BodySettings.raw`), in the file's own unit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from .. import plausible
from ..data import Array, Material
from ..elasticity import isotropic, orthotropic, turned_strain
from ..mesh import UNITS
from .mistakes import validate
from .numbers import (
    LENGTH,
    Box,
    Byte,
    Direction,
    Directions,
    EngineOrder,
    FaceName,
    Length,
    Model,
    Name,
    NodalDiameters,
    NodeNumber,
    NotNegative,
    Number,
    Numbers,
    Point,
    Positive,
    PositiveLength,
    Positives,
    Ratio,
    Ratios,
    Vector,
    _finite_vector,
    _float,
    _tuple,
    _whole,
    is_length,
    named_once,
    only_one,
)
from .toml import load_toml, override

GROUND = "ground"
"""Name of the rigid plane a face may press on."""


class FaceRule(Model):
    """How a face of a CAD file or of a mesh is picked: exactly one of the ways."""

    name: Name
    """name of the face; several rules of one name add up"""
    label: str | None = None
    """the surface's label in the CAD file, or a part of it"""
    colour: Annotated[tuple[Byte, Byte, Byte], BeforeValidator(_tuple)] | None = None
    """the surface's colour, red, green, blue"""
    box: Box | None = None
    """x, y, z of the low and of the high corner; what lies wholly inside"""
    cut: bool = False
    """CAD: whether the box cuts: its part of the surface becomes a face of its own"""
    surfaces: Annotated[tuple[int, ...], BeforeValidator(_tuple)] | None = None
    """numbers from the table of `microslip info FILE`"""
    touching: str | None = None
    """another file of the same kind in the same coordinates, or the body's own deck (what of it
    is not this body); where the two surfaces meet, cut out of a CAD file, of a mesh the facets
    whose middle lies there; with box: inside it"""

    @model_validator(mode="after")
    def _one_way(self) -> FaceRule:
        boxed = self.touching is not None and self.box is not None
        only_one(self, "label", "colour", *([] if boxed else ["box"]), "surfaces", "touching", what="a face ")
        if self.cut and (boxed or self.box is None):
            raise ValueError("cut: belongs to a box, whose part of the surface is cut out; leave it out")
        return self


UnitSystem = Literal["m-kg-s", "mm-t-s", "mm-kg-ms", "in-lbf-s"]


class MatrixFiles(Model):
    """Stiffness and mass that another program has assembled, the node and direction of every row, and positions.

    Modes are those of the symmetric part of the stiffness.
    """

    stiffness: str
    """K: FILE or FILE#NAME; .mtx, .mat, .h5, .npz, .op4, DMIG cards, .sti"""
    mass: str
    """M, likewise"""
    damping: str | None = None
    """C, likewise; instead of [damping]"""
    gyroscopic: str | None = None
    """G, likewise, skew-symmetric, at the speed of rotation.speeds_rpm"""
    circulatory: str | None = None
    """what the stiffness holds beside its symmetric part (friction, follower forces), any square
    matrix; goes to N_r, see [stability](stability.md)"""
    dofs: str | None = None
    """node and direction (1 to 6) of every row: lines `node.direction` or two columns; not
    needed where the matrices name their rows, or where every node has three or six rows in
    the order of `nodes`"""
    nodes: str | None = None
    """number, x, y, z: .csv, .mat, .h5, GRID cards, or a mesh with its sets; without it every
    row is a generalised coordinate and the supports are in the matrices"""
    units: UnitSystem | None = None
    """of the matrices; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"""
    grounded: bool = False
    """the supports are in the matrices already"""
    superelement: bool = False
    """rows without a node are the generalised coordinates of a superelement"""
    sets: dict[FaceName, Annotated[tuple[NodeNumber, ...], BeforeValidator(_tuple)]] = Field(default_factory=dict)
    """table: name of a set = list of node numbers"""


class MatrixTerm(Model):
    """A matrix that scales with a parameter: factor (value / reference)^power times it is added to
    those of its role."""

    role: Literal["stiffness", "mass", "damping", "gyroscopic", "circulatory"]
    """matrix it is added to"""
    matrix: str
    """FILE or FILE#NAME, times factor (value / reference)^power"""
    name: Name = "speed"
    """of the parameter; speed is that of rotation.speeds_rpm, in rad/s, any other stands in
    values"""
    power: Annotated[float, BeforeValidator(_float), Field(ge=-8, le=8)] = 1.0
    """-1 for what falls with the speed, 0 for a constant matrix"""
    factor: Number = 1.0
    """of the matrix"""
    reference: Positive = 1.0
    """value of the parameter at which the matrix stands as it is"""


class StabilitySettings(Model):
    """Which roots of (s^2 M + s C + K) x = 0 are wanted: all with growth rates and frequencies in
    a window."""

    growth: Annotated[tuple[Number, Number], BeforeValidator(_finite_vector)] = (-100.0, 1000.0)
    """[1/s] growth rates of the window of roots, from, to"""
    frequency: Annotated[tuple[NotNegative, NotNegative], BeforeValidator(_finite_vector)]
    """[Hz] frequencies of the window, from, to"""
    over: Name = "speed"
    """parameter of the diagram"""
    range: Annotated[tuple[Number, Number] | None, BeforeValidator(_finite_vector)] = None
    """its first and last value, speed in rad/s; no diagram if not given"""
    points: Annotated[int, Field(ge=2, le=10000)] = 100
    """number of values between them"""
    tolerance: Annotated[float, BeforeValidator(_float), Field(ge=1e-10, le=1e-2)] = 1e-7
    """largest relative error of a root at the values held out from the basis"""
    accuracy: Annotated[float, BeforeValidator(_float), Field(ge=0, le=0.1)] = 1e-8
    """relative, of the matrices' entries: decides which growth rates are neutral"""
    neutral: NotNegative = 0.0
    """[1/s] growth rates below it are neutral whatever the accuracy"""
    certify: bool = True
    """count the roots by the argument principle"""

    @model_validator(mode="after")
    def _has_area(self) -> StabilitySettings:
        for key, (low, high) in (("growth", self.growth), ("frequency", self.frequency)):
            if low >= high:
                raise ValueError(f"{key}: from {low:g} to {high:g} the window has no area; give the smaller one first")
        if self.range is not None and self.range[0] >= self.range[1]:
            raise ValueError("range must be two values of the parameter, the second above the first")
        return self


class Geometry(Model):
    """Where the body comes from: one of build (a script), cad (STEP, BREP, IGES), mesh (a file) or matrices."""

    build: str | None = None
    """a Python file that draws the body with gmsh; one outside its folder, by a path or a link,
    is refused"""
    cad: str | None = None
    """a STEP, BREP or IGES file"""
    mesh: str | None = None
    """a mesh file (.inp, .msh, .med, .unv, .vtu, ...) with named sets"""
    instances: Annotated[tuple[str, ...], BeforeValidator(_tuple)] = ()
    """those instances of the deck that are this body; all if not given"""
    matrices: MatrixFiles | None = None
    parameters: dict[str, Any] = Field(default_factory=dict)
    """table handed to the build file"""
    faces: Annotated[tuple[FaceRule, ...], BeforeValidator(_tuple)] = ()

    @model_validator(mode="after")
    def _one_source(self) -> Geometry:
        only_one(self, "build", "cad", "mesh", "matrices")
        if self.instances and self.mesh is None:
            raise ValueError("instances: are those of a deck; give it as mesh")
        return self


class Meshing(Model):
    """Target element size (length_unit) and local sizes by face name."""

    size: Annotated[Positive | None, LENGTH] = None
    """size of the elements; chosen from the body where it is not given"""
    order: Annotated[Literal[1, 2], BeforeValidator(_whole)] = 2
    """order of the elements; 1 is far too stiff in bending"""
    integration: Literal["full", "reduced", "reduced-mass", "calculix"] = "full"
    """of the stiffness; `"reduced"` takes 8 points in bricks of 20 nodes, which do not lock near
    a Poisson's ratio of 0.5; `"reduced-mass"` takes them for the mass too, as CalculiX does in
    C3D20R; `"calculix"` takes its one and two points in tetrahedra of 4 and wedges of 6 nodes
    alone"""
    local: dict[str, Positive] = Field(default_factory=dict)
    """[length_unit] table: name of a face = size there"""


def _at_right_angles(axes: Array) -> bool:
    with np.errstate(all="ignore"):  # a zero or immense axis gives NaN, which compares false
        unit = axes / np.linalg.norm(axes, axis=1)[:, None]
        return bool(np.abs(unit @ unit.T - np.eye(3)).max() < 1e-6)


class MaterialSettings(Model):
    """Isotropic (young, poisson) or orthotropic (young, poisson, shear as three numbers each, with axes)."""

    name: str = "material"
    """for the report"""
    density: Positive
    """[kg/m3]"""
    young: Positive | Positives
    """[Pa] Young's modulus; orthotropic: E1, E2, E3"""
    poisson: Annotated[float, BeforeValidator(_float), Field(gt=-1, lt=0.5)] | Numbers
    """Poisson's ratio; orthotropic: nu12, nu23, nu13"""
    shear: Positives | None = None
    """[Pa] orthotropic only: G12, G23, G13"""
    axes: Annotated[tuple[Vector, Vector, Vector], BeforeValidator(_finite_vector)] | None = None
    """orthotropic only: the material's three axes in body axes"""
    expansion: Number | Numbers = 0.0
    """[1/K] thermal expansion, one or along the three material axes"""
    temperature: Positives | None = None
    """[K] rising temperatures of `modulus_factor`"""
    modulus_factor: Positives | None = None
    """factor on the moduli at those temperatures; linear between, constant outside"""
    unusual: bool = False
    """silences the warnings about implausible units"""

    @model_validator(mode="after")
    def _consistent(self) -> MaterialSettings:
        if isinstance(self.young, tuple):
            for key in ("young", "poisson", "shear"):
                value = getattr(self, key)
                if not isinstance(value, tuple) or len(value) != 3:
                    raise ValueError(f"an orthotropic material needs three numbers for {key}")
        elif self.shear is not None or isinstance(self.poisson, tuple):
            raise ValueError("an isotropic material has one young, one poisson and no shear")
        if (self.temperature is None) != (self.modulus_factor is None):
            raise ValueError("temperature and modulus_factor come together")
        if self.temperature is not None:
            if not self.temperature or len(self.temperature) != len(self.modulus_factor or ()):
                raise ValueError("temperature and modulus_factor must have the same length")
            if any(b <= a for a, b in zip(self.temperature[:-1], self.temperature[1:], strict=True)):
                raise ValueError("temperature must rise from entry to entry")
        if isinstance(self.expansion, tuple) and len(self.expansion) != 3:
            raise ValueError("expansion is one number or three along the material axes")
        if self.axes is not None and not _at_right_angles(np.array(self.axes)):
            raise ValueError("axes must be three directions at right angles")
        with np.errstate(all="ignore"):
            built = self.material()
        if not (np.isfinite(built.elasticity).all() and np.isfinite(built.expansion).all()):
            raise ValueError("young, poisson, shear and expansion give no finite stiffness")
        return self

    def material(self) -> Material:
        """The `Material` in body axes."""
        axes = None if self.axes is None else np.array([np.array(a) / np.linalg.norm(a) for a in self.axes])
        if isinstance(self.young, tuple):
            try:
                C = orthotropic(np.array(self.young), np.array(self.poisson), np.array(self.shear), axes)
            except ValueError as error:
                raise ValueError(f"the {error}; lower poisson's ratios or check the order of the moduli") from error
        else:
            assert isinstance(self.poisson, float)
            C = isotropic(self.young, self.poisson)
        alpha = np.broadcast_to(np.asarray(self.expansion, dtype=float), 3)
        voigt = turned_strain(alpha, axes)
        table = None
        if self.temperature is not None:
            table = np.column_stack([self.temperature, self.modulus_factor or ()])
        return Material(self.density, C, voigt, table, self.name)


class ForeignMaterial(Model):
    """The material stands elsewhere: in the mesh file, or in the matrices, which hold it."""

    source: Annotated[Literal["mesh", "matrices"], Field(alias="from")]
    """the mesh file's own material, or materials"""
    units: UnitSystem | None = None
    """of the mesh file; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"""
    density: Positive | None = None
    """[kg/m3] of those materials of the mesh file that have none"""
    young: Positive | None = None
    """[Pa] Young's modulus of those that have none, or are of a kind that is not read"""
    poisson: Annotated[float, BeforeValidator(_float), Field(gt=-1, lt=0.5)] | None = None
    """Poisson's ratio of those that have none"""
    unusual: bool = False
    """silences the warnings about implausible units"""

    @property
    def name(self) -> str:
        return f"from the {self.source}"


def _material_kind(value: Any) -> str:
    return "foreign" if isinstance(value, ForeignMaterial) or (isinstance(value, dict) and "from" in value) else "own"


AnyMaterial = Annotated[
    Annotated[MaterialSettings, Tag("own")] | Annotated[ForeignMaterial, Tag("foreign")], Discriminator(_material_kind)
]


class Temperature(Model):
    """Stress-free (reference) and actual temperature: uniform, a CSV file of x, y, z, T, or those of the mesh file."""

    source: Annotated[Literal["mesh"] | None, Field(alias="from")] = None
    """both temperatures from the mesh file"""
    scale: Literal["C", "K"] = "C"
    """of the mesh file's temperatures: °C or K"""
    reference: Positive = 293.15
    """[K] free of thermal stress"""
    uniform: Positive | None = None
    """[K] one temperature everywhere"""
    file: str | None = None
    """[length_unit, K] CSV lines x, y, z, T; linear between, nearest outside"""

    @model_validator(mode="after")
    def _one_source(self) -> Temperature:
        if self.uniform is not None and self.file is not None:
            raise ValueError("give uniform or file, not both")
        if self.source and (self.uniform is not None or self.file is not None or "reference" in self.model_fields_set):
            raise ValueError('from = "mesh" takes both temperatures from the mesh file; remove the others')
        return self

    @property
    def zero(self) -> float:
        """K of the temperature 0 in the mesh file."""
        return 273.15 if self.scale == "C" else 0.0


class Support(Model):
    """A face, or a point set, whose displacement is held in the named body directions."""

    face: FaceName
    """face, or set of points, that is held"""
    directions: Directions = "xyz"
    """body directions in which it is held"""
    rotations: bool | Directions = False
    """hold rotations of its nodes too, all or some (matrices, reference nodes)"""

    @property
    def turns(self) -> list[int]:
        """Rotations about x, y, z that are held too, as 3, 4, 5: of reference nodes and of nodes of matrices."""
        axes = self.rotations if isinstance(self.rotations, str) else "xyz" * self.rotations
        return [3 + "xyz".index(c) for c in axes]


class Cyclic(Model):
    """The body is one of `sectors` alike round the rotation axis; right is left turned by 2 pi / sectors."""

    sectors: Annotated[int, Field(ge=3, le=1000)]
    """N, how many of this body make the ring"""
    left: FaceName = "cyclic_left"
    """face towards the previous sector"""
    right: FaceName = "cyclic_right"
    """face towards the next sector: the left one turned by 2 pi / N about the rotation axis"""
    follows: Literal["right", "left"] = "right"
    """whose nodes follow the other face where the two are not meshed alike"""
    nodal_diameters: NodalDiameters = "all"
    """which to analyse, or all from 0 to N/2"""

    @model_validator(mode="after")
    def _possible(self) -> Cyclic:
        if self.left == self.right:
            raise ValueError("left and right must be two faces")
        if self.nodal_diameters != "all":
            wanted = self.nodal_diameters
            if not wanted or len(set(wanted)) < len(wanted):
                raise ValueError('nodal_diameters must name each of them once, or be "all"')
            if max(wanted) > self.sectors // 2:
                raise ValueError(
                    f"nodal_diameters: {max(wanted)} is more than {self.sectors} sectors can have "
                    f"({self.sectors // 2}); higher orders alias onto these"
                )
        return self

    @property
    def harmonics(self) -> tuple[int, ...]:
        """Nodal diameters asked for, ascending."""
        every = range(self.sectors // 2 + 1)
        return tuple(every) if self.nodal_diameters == "all" else tuple(sorted(self.nodal_diameters))


class Rotation(Model):
    """Rotation about an axis and the speeds to analyse."""

    axis: Direction = (0.0, 1.0, 0.0)
    """direction of the rotor axis"""
    point: Point = (0.0, 0.0, 0.0)
    """a point of the axis"""
    speeds_rpm: Numbers = (0.0,)
    """[rpm] speeds to analyse, rising"""
    prestress: Literal["nonlinear", "linear", "none"] = "nonlinear"
    """how the stiffness at speed is made, see [modes](modes.md#equilibrium-at-speed): equilibrium
    by Newton, then the tangent; one linear solution; or as the book prints it (2.3-29), with the
    softening term only, where frequencies fall with speed"""
    spin_softening: bool = True
    """whether -Omega^2 M P is in K"""
    gyroscopic: bool = True
    """whether the modes with gyroscopic coupling are computed at speed, see rotation.md"""
    engine_orders: Annotated[tuple[EngineOrder, ...], BeforeValidator(_tuple)] = ()
    """lines of the Campbell diagram"""
    range_rpm: Annotated[tuple[NotNegative, NotNegative], BeforeValidator(_finite_vector)] | None = None
    """[rpm] lowest and highest speed of one basis for all speeds between, see speeds.md"""
    range_points: Annotated[int, Field(ge=2, le=2000)] = 50
    """speeds of the Campbell diagram over the range"""
    range_tolerance: Annotated[float, BeforeValidator(_float), Field(ge=1e-8, le=1e-2)] = 1e-4
    """relative frequency error allowed at held-out speeds of the range"""
    range_stress: bool = False
    """strain and stress modes at every speed of the range (large files)"""

    @model_validator(mode="after")
    def _sensible(self) -> Rotation:
        if not self.speeds_rpm or min(self.speeds_rpm) < 0 or list(self.speeds_rpm) != sorted(set(self.speeds_rpm)):
            raise ValueError("speeds_rpm must be one or more rising numbers, none negative")
        if self.range_rpm is not None and self.range_rpm[0] >= self.range_rpm[1]:
            raise ValueError("range_rpm must be two speeds, the second above the first; for one speed use speeds_rpm")
        return self


class Load(Model):
    """A static load that acts at every speed: gravity (m/s2), pressure on a face (Pa), force on a
    face or point (N), or all that the static step of the mesh file holds but its rotation."""

    kind: Literal["gravity", "pressure", "force", "mesh"]
    """a static load that acts at every speed; mesh: forces, pressures, accelerations and prescribed
    displacements of the file's static step, pressures following the surface"""
    face: FaceName | None = None
    """of a pressure or a force"""
    point: Point | None = None
    """of a force"""
    value: Number | None = None
    """[Pa] of a pressure, positive into the body"""
    vector: Vector | None = None
    """[m/s2 or N] of gravity or a force"""
    follows: bool = False
    """whether a pressure follows the surface as it moves and turns, in the modes too"""

    @model_validator(mode="after")
    def _complete(self) -> Load:
        if self.kind == "pressure" and (self.face is None or self.value is None):
            raise ValueError("a pressure needs face and value (Pa, positive pushes into the body)")
        if self.follows and self.kind != "pressure":
            raise ValueError("follows belongs to a pressure; leave it out")
        if self.kind == "gravity" and self.vector is None:
            raise ValueError("gravity needs vector (m/s2)")
        if self.kind == "force" and (self.vector is None or (self.face is None) == (self.point is None)):
            raise ValueError("a force needs vector (N) and either face or point")
        return self


class Closure(Model):
    """Two faces that may touch in the static state, without friction; Newton finds where they do
    and how hard."""

    name: Name
    """the contact's name in the modal file and the report"""
    face: FaceName
    """face whose points are held apart from the other side (the finer meshed one)"""
    against: FaceName
    """the face it meets, or `ground`, a rigid plane"""
    sector_shift: Annotated[Literal[-1, 0, 1], BeforeValidator(_whole)] = 0
    """where that face is: next blade 1, previous -1, this body 0"""
    interference: Length = 0.0
    """by how much the drawn faces overlap when assembled; negative: a further gap"""
    point: Point | None = None
    """of the ground; the middle of the face if not given"""
    normal: Direction | None = None
    """of the ground, towards the body; opposite to the face if not given"""
    modes: Literal["open", "closed"] = "open"
    """`open`: the modes leave the contact to the friction law, its static force stays; `closed`:
    they keep its stiffness along the normal, free to slide"""
    slide: PositiveLength | None = None
    """how far the faces may slide on each other; 1.5 elements if not given"""
    penalty: Positive | None = None
    """[Pa/m] only the number of iterations depends on it; chosen from the modulus if not given"""

    @model_validator(mode="after")
    def _sides(self) -> Closure:
        if self.against == GROUND and self.sector_shift:
            raise ValueError("sector_shift: the ground has no sectors; write 0 or name a face in against")
        if self.against != GROUND and (self.point or self.normal):
            raise ValueError('point and normal describe the ground; write against = "ground" or leave them out')
        if self.against == self.face and not self.sector_shift:
            raise ValueError("face and against are the same face of the same body; correct one, or give sector_shift")
        return self


class Bolt(Model):
    """A tensioned bolt: its preload presses a face (under its head) and the face against it (under
    its nut)."""

    name: Name
    """by which messages name it"""
    face: FaceName
    """the ring under the head"""
    against: FaceName = "ground"
    """the ring under the nut; `ground`: it goes into something rigid, or into the other half of a
    symmetric joint"""
    preload: Positive
    """[N] force of the bolt; keeps its direction"""


class _Attached(Model):
    """What is fastened to a face, or at a point."""

    face: FaceName | None = None
    """face, or set of points, that it is fastened to"""
    point: Point | None = None
    """or a place: the nearest node, which moves and does not turn"""
    centre: Point | None = None
    """where it acts, beside the face too; the middle of the face if not given"""
    coupling: Literal["mean", "rigid"] = "mean"
    """`mean`: it follows the mean motion of the face, which stays as soft as it is; `rigid`: the face moves as
    one rigid body"""

    @model_validator(mode="after")
    def _one_place(self) -> _Attached:
        only_one(self, "face", "point")
        if self.face == GROUND:
            raise ValueError("face: the ground is no face; name one of the body")
        if self.point is not None and self._turned():
            raise ValueError("a point does not turn: centre, inertia and rotational need a face")
        return self

    def _turned(self) -> bool:
        return self.centre is not None


class AttachedMass(_Attached):
    """A point mass, or a rigid body by its mass and inertia: what is bolted on and not meshed."""

    mass: Positive
    """[kg]"""
    inertia: Annotated[tuple[Number, ...] | None, BeforeValidator(_finite_vector)] = None
    """[kg m2] moments about its centre along body axes: xx, yy, zz, or these and the entries xy, yz, xz of its
    tensor"""

    @model_validator(mode="after")
    def _body(self) -> AttachedMass:
        if self.inertia is not None:
            if len(self.inertia) not in (3, 6):
                raise ValueError("inertia is three numbers, xx, yy, zz, or six, with xy, yz, xz")
            principal = np.linalg.eigvalsh(self.tensor())
            if not 0 <= principal[0] or principal[2] > (1 + 1e-9) * (principal[0] + principal[1]):
                raise ValueError("inertia: no rigid body has these moments; each is at most the sum of the others")
        return self

    def _turned(self) -> bool:
        return super()._turned() or self.inertia is not None

    def tensor(self) -> Array:
        """(3, 3) of the inertia."""
        xx, yy, zz, xy, yz, xz = (*(self.inertia or (0.0,) * 3), 0.0, 0.0, 0.0)[:6]
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class _Between(_Attached):
    """What acts between a face and another one, or the ground."""

    against: FaceName = GROUND
    """the face at its other end, or `ground`"""
    direction: Direction | None = None
    """of a single number; its length does not matter"""
    rotational: Annotated[tuple[NotNegative, NotNegative, NotNegative] | None, BeforeValidator(_finite_vector)] = None
    """[N m or N m s per rad] of rotations about x, y, z"""

    @model_validator(mode="after")
    def _directed(self) -> _Between:
        values = self.values()
        if (self.direction is None) == isinstance(values, float):
            raise ValueError("a single number needs a direction, three along x, y, z have none")
        if values is None and self.rotational is None:
            raise ValueError("gives no force; write numbers along x, y, z, one with a direction, or rotational")
        if self.against == self.face:
            raise ValueError("against is the face itself; name another one, or ground")
        if self.against != GROUND and self.point is not None:
            raise ValueError("against: a point is joined to the ground alone; give a face in its place")
        return self

    def _turned(self) -> bool:
        return super()._turned() or self.rotational is not None

    def values(self) -> float | tuple[float, ...] | None:
        """Along `direction`, or along x, y, z."""
        raise NotImplementedError

    def matrix(self) -> Array:
        """(6, 6) over displacements and rotations along body axes."""
        A, values = np.zeros((6, 6)), self.values()
        if isinstance(values, float):
            e = np.array(self.direction) / np.linalg.norm(np.array(self.direction))
            A[:3, :3] = values * np.outer(e, e)
        elif values is not None:
            A[:3, :3] = np.diag(values)
        A[3:, 3:] = np.diag(self.rotational or np.zeros(3))
        return A


_ThreeOrOne = Positive | Annotated[tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(_finite_vector)]


class AttachedSpring(_Between):
    """A spring from a face or point to the ground or another face."""

    stiffness: _ThreeOrOne | None = None
    """[N/m] along x, y, z, or one along `direction`"""

    def values(self) -> float | tuple[float, ...] | None:
        return self.stiffness


class AttachedDashpot(_Between):
    """A dashpot from a face or point to the ground or another face."""

    damping: _ThreeOrOne | None = None
    """[N s/m] along x, y, z, or one along `direction`"""

    def values(self) -> float | tuple[float, ...] | None:
        return self.damping


class InterfaceSettings(Model):
    """A contact patch with the frame n, t1, t2; n points outwards."""

    name: Name
    """by which cases name it"""
    face: FaceName
    """the contact patch"""
    role: Literal["left", "right", "ground", "bolt", "load"] = "ground"
    """see [conventions](conventions.md#frames)"""
    partner: str = ""
    """name of the interface it faces"""
    sector_shift: Annotated[Literal[-1, 0, 1], BeforeValidator(_whole)] = 0
    """where the partner is: next blade 1, previous -1, else 0"""
    t2: Direction | None = None
    """direction whose projection on the patch becomes t2; if not given z, or y where the patch
    lies across z"""
    normal: Direction | None = None
    """outward normal of a list of nodes that does not tell it itself (matrices only)"""
    coordinates: Literal["rigid", "characteristic"] = "rigid"
    """rigid: six; characteristic: six and the softest shapes of the patch"""
    count: Annotated[int, Field(ge=0, le=500)] = 0
    """how many characteristic shapes"""

    @model_validator(mode="after")
    def _counted(self) -> InterfaceSettings:
        if self.coordinates == "characteristic" and (not self.count or self.role == "load"):
            raise ValueError('coordinates = "characteristic" needs count, the number of shapes, and no role "load"')
        if self.coordinates == "rigid" and self.count:
            raise ValueError('count belongs to coordinates = "characteristic"; a rigid patch has six coordinates')
        return self


class Excitation(Model):
    """Unit load: a force (N) at a point or over a face, `pressure` on a face (1 Pa), or `centrifugal` (1 rad2/s2)."""

    name: Name
    """by which cases name it"""
    point: Point | None = None
    """where a unit force acts"""
    node: NodeNumber | None = None
    """or the number of a node in the mesh file"""
    face: FaceName | None = None
    """or the face over which it is spread"""
    direction: Direction | None = None
    """of the force; its length does not matter"""
    pressure: bool = False
    """a unit pressure (1 Pa) on the face instead"""
    centrifugal: bool = False
    """the centrifugal force on the whole body per (rad/s)^2 about the [rotation] axis"""

    @model_validator(mode="after")
    def _one_kind(self) -> Excitation:
        if self.centrifugal:
            if any(v is not None for v in (self.point, self.node, self.face, self.direction)) or self.pressure:
                raise ValueError("centrifugal = true acts on the whole body, about [rotation]; remove the others")
            return self
        only_one(self, "point", "node", "face")
        if self.pressure and (self.face is None or self.direction is not None):
            raise ValueError("pressure = true needs a face and no direction")
        if not self.pressure and self.direction is None:
            raise ValueError("needs a direction (or pressure = true)")
        return self


class Monitor(Model):
    """Displacement read-out along body directions at a point, or the angle by which points turn about an axis."""

    name: Name
    """by which cases name it"""
    point: Point | None = None
    """where displacements are read"""
    node: NodeNumber | None = None
    """or the number of a node in the mesh file"""
    directions: Directions = "xyz"
    """body directions"""
    points: (
        Annotated[tuple[Point, ...], BeforeValidator(_tuple), Field(min_length=2, max_length=1000), LENGTH] | None
    ) = None
    """or places that turn: read is the angle, rad, about `axis` of the rigid motion that fits
    them best; two read the difference of their displacements over their distance"""
    axis: Direction | None = None
    """of that angle, right-handed; neither its length nor its place matters"""

    @model_validator(mode="after")
    def _one_place(self) -> Monitor:
        only_one(self, "point", "node", "points")
        if (self.points is None) != (self.axis is None):
            raise ValueError(
                "points and axis belong together: the angle by which these points turn about it; give both"
            )
        if self.points is not None and "directions" in self.model_fields_set:
            raise ValueError("directions belong to a point or node; points turn about their axis, remove directions")
        return self


class Gauge(Model):
    """Strain gauge: normal strain along `direction` at a point."""

    name: Name
    """by which cases name it"""
    point: Point
    """where the strain is read"""
    direction: Direction
    """of the strain gauge"""


class Modes(Model):
    """How many modes, or up to which frequency."""

    count: Annotated[int, Field(ge=1, le=2000)] = 20
    """how many modes"""
    max_frequency: Positive | None = None
    """[Hz] only modes below it; `count` is then the upper limit"""
    certify: bool = True
    """prove by an inertia count that none is missing"""
    solver: Literal["auto", "pardiso", "superlu", "petsc"] = "auto"
    """sparse direct solver, see [platforms](platforms.md)"""
    ranks: Annotated[int, Field(ge=1, le=10000)] = 1
    """processes that share a factorisation (`solver = "petsc"`)"""

    @model_validator(mode="after")
    def _ranks_of_petsc(self) -> Modes:
        if self.ranks > 1 and self.solver != "petsc":
            raise ValueError('ranks share the work of solver = "petsc"; give that solver, or remove ranks')
        return self


class Damping(Model):
    """Modal damping: one ratio, a table of ratios per mode, or Rayleigh D = alpha M + beta K (Sextro Eq. (2.4-3))."""

    ratio: Ratio | None = None
    """one damping ratio D for all modes"""
    table: Ratios | None = None
    """a ratio per mode; the last one serves all further modes"""
    alpha: NotNegative | None = None
    """[1/s] Rayleigh damping alpha M + beta K"""
    beta: NotNegative | None = None
    """[s] Rayleigh damping"""

    @model_validator(mode="after")
    def _one_source(self) -> Damping:
        given = [self.ratio is not None, self.table is not None, self.alpha is not None or self.beta is not None]
        if sum(given) > 1:
            raise ValueError("give one of ratio, table, or alpha and beta")
        return self

    @property
    def source(self) -> str:
        if self.table is not None:
            return "table"
        if self.alpha is not None or self.beta is not None:
            return f"rayleigh alpha={self.alpha or 0.0:g} 1/s beta={self.beta or 0.0:g} s"
        return "ratio"

    def ratios(self, omega: Array) -> Array:
        """(m,) damping ratios D_j of Sextro Eq. (2.4-13); rigid modes get 0."""
        safe = np.where(omega > 0, omega, np.inf)
        if self.table is not None:
            tail = self.table[-1] if self.table else 0.0
            padded = [*self.table, *[tail] * len(omega)][: len(omega)]
            return np.where(omega > 0, padded, 0.0)
        if self.alpha is not None or self.beta is not None:
            return 0.5 * ((self.alpha or 0.0) / safe + (self.beta or 0.0) * omega)
        return np.where(omega > 0, self.ratio or 0.0, 0.0)


class Output(Model):
    """What the modal file holds beside frequencies and rows."""

    shapes: bool = True
    """mode shapes at all nodes"""
    patch_shapes: bool = True
    """mode shapes at the points of contact and load faces"""
    gauss: bool = True
    """strain and stress modes at integration points (the largest part of the file)"""
    nodal_stress: bool = True
    """strain and stress modes smoothed to the nodes"""
    stiffening: bool = False
    """whether the modal file holds how large rigid motion stiffens the body, see rotation.md"""
    stress_nodal_diameters: NodalDiameters = "all"
    """nodal diameters whose stress modes are kept (a file grows by them)"""
    shape_nodal_diameters: NodalDiameters = "all"
    """nodal diameters whose shapes, of body and patches, are kept"""

    @model_validator(mode="after")
    def _possible(self) -> Output:
        if self.stiffening and not self.shapes:
            raise ValueError("stiffening needs shapes = true")
        return self

    def stress_at(self, harmonic: int) -> bool:
        """Whether strain and stress modes are wanted of a nodal diameter."""
        return self.stress_nodal_diameters == "all" or harmonic in self.stress_nodal_diameters

    def shapes_at(self, harmonic: int) -> bool:
        """Whether shapes of the body and of its patches are wanted of a nodal diameter."""
        return self.shape_nodal_diameters == "all" or harmonic in self.shape_nodal_diameters


class BodySettings(Model):
    """A whole body.toml."""

    name: Name
    """names the products: `meshes/NAME.msh`, `build/NAME/`, of no other body of the name"""
    description: str = ""
    """one line for the report"""
    length_unit: Literal["m", "cm", "mm", "um", "in", "ft"]
    """unit of every length in this file and of the mesh or CAD file"""
    reduction: Literal["eigenmodes", "macneal", "rubin", "craig-bampton", "dual-craig-bampton", "massless-boundary"] = (
        "eigenmodes"
    )
    """method of reduction, see reduction.md"""
    free: bool = False
    """the body is meant to float; rigid motions are kept, [at speed](rotation.md#free-bodies)
    too"""
    geometry: Geometry
    mesh: Meshing = Field(default_factory=Meshing)
    material: AnyMaterial
    temperature: Temperature = Field(default_factory=Temperature)
    supports: Annotated[tuple[Support, ...], BeforeValidator(_tuple)] = ()
    cyclic: Cyclic | None = None
    rotation: Rotation = Field(default_factory=Rotation)
    loads: Annotated[tuple[Load, ...], BeforeValidator(_tuple)] = ()
    closures: Annotated[tuple[Closure, ...], BeforeValidator(_tuple)] = ()
    bolts: Annotated[tuple[Bolt, ...], BeforeValidator(_tuple)] = ()
    masses: Annotated[tuple[AttachedMass, ...], BeforeValidator(_tuple)] = ()
    springs: Annotated[tuple[AttachedSpring, ...], BeforeValidator(_tuple)] = ()
    dashpots: Annotated[tuple[AttachedDashpot, ...], BeforeValidator(_tuple)] = ()
    interfaces: Annotated[tuple[InterfaceSettings, ...], BeforeValidator(_tuple)] = ()
    excitations: Annotated[tuple[Excitation, ...], BeforeValidator(_tuple)] = ()
    monitors: Annotated[tuple[Monitor, ...], BeforeValidator(_tuple)] = ()
    gauges: Annotated[tuple[Gauge, ...], BeforeValidator(_tuple)] = ()
    modes: Modes = Field(default_factory=Modes)
    damping: Damping = Field(default_factory=Damping)
    output: Output = Field(default_factory=Output)
    parameters: Annotated[tuple[MatrixTerm, ...], BeforeValidator(_tuple)] = ()
    values: dict[Name, Number] = Field(default_factory=dict)
    """table: name of a parameter = its value, 1 if not given; the speed stands in
    rotation.speeds_rpm"""
    stability: StabilitySettings | None = None
    note: str = ""
    """a remark that `modes` and the report repeat; `import` says here what it left out of a mesh
    file"""

    @model_validator(mode="before")
    @classmethod
    def _matrices_hold_the_material(cls, raw: Any) -> Any:
        """Matrices need no material; it may be left out."""
        if isinstance(raw, dict) and isinstance(given := raw.get("geometry"), dict):
            if given.get("matrices") is not None and "material" not in raw:
                return {**raw, "material": {"from": "matrices"}}
        return raw

    @model_validator(mode="after")
    def _names_once(self) -> BodySettings:
        named_once(self, "closures", "bolts", "interfaces", "excitations", "monitors gauges")
        if self.geometry.matrices is not None:
            self._only_what_matrices_can()
        elif self.parameters:
            raise ValueError("parameters: belong to geometry.matrices; remove them")
        elif isinstance(self.material, ForeignMaterial):
            if self.material.source == "matrices" or self.geometry.mesh is None:
                raise ValueError('material.from: "mesh" needs geometry.mesh; write density, young and poisson instead')
        if any(load.kind == "mesh" for load in self.loads) and self.geometry.mesh is None:
            raise ValueError('loads: "mesh" are those of a mesh file; give geometry.mesh')
        if self.closures and self.rotation.prestress != "nonlinear":
            raise ValueError('closures: contact is found by Newton only; set rotation.prestress = "nonlinear"')
        for key in ("stress_nodal_diameters", "shape_nodal_diameters"):
            beyond = getattr(self.output, key)
            if beyond != "all" and max(beyond, default=0) > (self.cyclic.sectors // 2 if self.cyclic else 0):
                raise ValueError(
                    f"output.{key}: {max(beyond)} is more than "
                    f"{f'{self.cyclic.sectors} sectors' if self.cyclic else 'a body without [cyclic]'} can have; "
                    "correct it"
                )
        return self

    def _only_what_matrices_can(self) -> None:
        """Refuse what needs finite elements of ours."""
        if not isinstance(self.material, ForeignMaterial) or self.material.source != "matrices":
            raise ValueError("material: the matrices hold the material already; remove [material]")
        needs = {
            "cyclic": self.cyclic, "closures": self.closures, "bolts": self.bolts, "loads": self.loads,
            "masses": self.masses, "springs": self.springs, "dashpots": self.dashpots,
            "gauges": self.gauges, "excitations.centrifugal": any(e.centrifugal for e in self.excitations),
            "rotation.range_rpm": self.rotation.range_rpm, "temperature.file": self.temperature.file,
            "temperature.uniform": self.temperature.uniform, "geometry.faces": self.geometry.faces,
            "rotation.speeds_rpm": len(self.rotation.speeds_rpm) > 1,
        }  # fmt: skip
        if found := [key for key, value in needs.items() if value]:
            raise ValueError(f"{found[0]}: matrices are of one state and bring no elements for this; remove it")
        placed = ("supports", "interfaces", "excitations", "monitors")
        if self.geometry.matrices is not None and self.geometry.matrices.nodes is None:
            if found := [key for key in placed if getattr(self, key)]:
                raise ValueError(f"{found[0]}: without nodes there are no places; give geometry.matrices.nodes")
        known = sorted({term.name for term in self.parameters} - {"speed"})
        if unknown := sorted(set(self.values) - set(known)):
            names = ", ".join(known) or "none"
            way = "rotation.speeds_rpm gives it" if unknown[0] == "speed" else f"choose from {names}"
            raise ValueError(f"values.{unknown[0]}: no matrix scales with it here; {way}")


def load_body(path: Path | str, assignments: list[str] | None = None) -> tuple[BodySettings, dict[str, Any]]:
    """Read and check a body file.

    Args:
        path: of the body.toml. assignments: ``--set`` texts.

    Returns:
        The settings in SI (lengths in metres), and the file's own table (lengths in its own unit).

    Raises:
        UserError: with every mistake named by file and key.
    """
    path = Path(path)
    raw = override(load_toml(path), assignments or [], path)
    return body_settings(raw, path), raw


def body_settings(raw: dict[str, Any], path: Path) -> BodySettings:
    """The settings of a body file's table in SI. path: for messages.

    Raises:
        UserError: with every mistake named by file and key.
    """
    settings = validate(BodySettings, raw, path)
    return to_metres(settings, UNITS[settings.length_unit])


def to_metres(model: Any, scale: float) -> Any:
    """Multiply every number marked as a length, and every area by the square, at any depth."""
    if isinstance(model, tuple):
        return tuple(to_metres(m, scale) for m in model)
    if not isinstance(model, BaseModel):
        return model
    update = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if name == "area":
            update[name] = _scaled(value, scale**2)
        elif is_length(field):
            update[name] = _scaled(value, scale)
        elif name == "local":
            update[name] = {k: v * scale for k, v in value.items()}
        else:
            update[name] = to_metres(value, scale)
    return model.model_copy(update=update)


def _scaled(value: Any, scale: float) -> Any:
    if value is None:
        return None
    return tuple(_scaled(v, scale) for v in value) if isinstance(value, tuple) else value * scale


def implausible(settings: BodySettings, size: float) -> list[str]:
    """Warnings about values that suggest a unit mistake (suppressed by material.unusual = true).

    Args:
        size: largest extent of the body, m.
    """
    found = []
    m = settings.material
    if isinstance(m, MaterialSettings) and not m.unusual:
        stiff = max(m.young) if isinstance(m.young, tuple) else m.young
        found += [plausible.density("material.density", m.density), plausible.modulus("material.young", stiff)]
    if text := plausible.extent(size, settings.length_unit):
        found.append(f"{text} (material.unusual = true silences warnings of this kind)")
    if settings.mesh.size is not None and settings.mesh.size > size:
        found.append(f"mesh.size = {settings.mesh.size:g} m is more than the body's {size:g} m; is it in length_unit?")
    return [] if m.unusual else [text for text in found if text]
