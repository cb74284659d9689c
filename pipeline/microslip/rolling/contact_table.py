"""Contacts of a wheelset over lateral shift and yaw, for vehicle programs: from a pose to its forces in microseconds.

The roll follows: both wheels carry the same. The right wheel is enough, as the left one is that of the mirrored pose,
and half of the yaw, as a yaw to the other side turns only what is ahead.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..errors import UserError
from ..programs import program
from ..progress import Report
from ..settings import arguments
from ..settings.arguments import Count, Index, wholes
from ..settings.numbers import Positive
from . import strips
from .arguments import Frictions, NotNegatives, Positives, Reals
from .strips import Array
from .table import read_table, write_table
from .wheelset import Pose, RollingPatch, Track, axle, creepages

POINTS = (161, 4)
"""Of the lateral shift to one side, and of the yaw."""

POSES = 64
"""That are read at once; a single one is read alone."""

EMPTY = 1e-9
"""N that stands for no force: the strips divide by it."""


class Patches(NamedTuple):
    """Arrays (..., k) of the patches of a wheel, from its field side to its flange; normal_force is 0 of none.

    Attributes:
        ahead: x over the sine of the yaw, m. y, z: in track axes, m. on_rail, on_wheel: y of the profiles, m. radius:
            of the wheel there, m. angle: of the rail, rad. a, b: m. pressure: Pa. normal_force: N.
    """

    ahead: Array
    y: Array
    z: Array
    on_rail: Array
    on_wheel: Array
    radius: Array
    angle: Array
    a: Array
    b: Array
    pressure: Array
    normal_force: Array


class WheelForces(NamedTuple):
    """Of n poses, both wheels, left first, and k patches each, in the axes of `wheelset.RollingPatch`.

    Attributes:
        patches: (n, 2, k); those of the left wheel are mirrored back. xi, eta: creepages, phi: 1/m, speed: m/s,
            (n, 2, k). creep: `strips.CreepForces` of each. felt: (n, 2, 6) force and moment about the middle of the
            axle that a wheel feels, in track axes, N and N m. roll: (n,) rad. down: (n,) z of the axle's middle, m.
            jumps: (n, 2) whether a contact jumps nearby: then it is that of the nearest pose of the table.
    """

    patches: Patches
    xi: Array
    eta: Array
    phi: Array
    speed: Array
    creep: strips.CreepForces
    felt: Array
    roll: Array
    down: Array
    jumps: Array


class ContactTable(NamedTuple):
    """Contacts of the right wheel over lateral shift and yaw; `forces` reads it for both.

    Attributes:
        reach: (2,) lateral, m, and yaw, rad, to either side. load: vertical, on each wheel, N, which
            normal forces carry alone. radius: nominal, m.
        shear, poisson: G (Pa) and nu of both bodies. patches: (m, n, k), n equal steps of the shift from -reach on, m
        of the square of the yaw from 0 on. roll, down: (m, n) rad and z of the axle's middle, m. cells: (m - 1, n - 1)
        read by cubics over the shift and straight over the squared yaw (0), straight over both (1), or not between its
        corners (2), as patches come, go or jump there. error: (4, 3) of `MISSED`, at random poses that are not near a
        jump, the mean, what 95 % are below, and the largest. checked: wheels that were looked at. jumping: share of
        them near a jump.
    """

    reach: Array
    load: float
    radius: float
    shear: float
    poisson: float
    patches: Patches
    roll: Array
    down: Array
    cells: Array
    error: Array
    checked: int
    jumping: float

    def __repr__(self) -> str:
        return f"<ContactTable: {self.sentence()}>"

    @arguments.checked
    def forces(
        self, lateral: Reals, yaw: Reals, speed: Positives, friction: Frictions, *, turning: Reals | None = None,
        load: NotNegatives | None = None, xi: Reals = 0.0, eta: Reals = 0.0, phi: Reals = 0.0,
    ) -> WheelForces:  # fmt: skip
        """Patches and forces of n poses, by the strips of `strips.creep_forces`.

        Args:
            lateral: to the right, m. yaw: rad. speed: m/s. friction: coefficient. turning: of the axle, rad/s; None: it
                rolls. load: vertical, N, broadcasts to (n, 2), which normal and tangential forces of a wheel carry
                together; places and roll stay those of the table's. xi, eta, phi:
                what motion of the wheelset adds to the creepages of its pose, 1/m of phi; (n,), or (n, 2) of the left
                and of the right wheel, as yawing adds to one what it takes from the other.

        Raises:
            UserError: a pose beyond the table, or a value that none has; friction that drags a wheel down its flange
                by all that lifts it.
        """
        turning = np.asarray(speed, float) / self.radius if turning is None else turning
        given, loads = _together(
            (lateral, yaw, speed, friction, turning), (xi, eta, phi), self.load if load is None else load
        )
        n = len(loads)
        for name, v, reach in zip(("lateral", "yaw"), given, self.reach, strict=False):
            worst = v[np.argmax(np.abs(v))]
            if not abs(worst) <= reach * (1 + 1e-9):
                raise UserError(f"{name}: is {worst:.4g}, and the table goes from {-reach:.4g} to {reach:.4g}")
        size = POSES if n > 1 else 1
        which = np.minimum(np.arange(-(-n // size) * size), n - 1).reshape(-1, size)
        runs = (_rolling(self, *(v[which[run]] for v in (*given, loads))) for run in strips.runs(n, size))
        found = [jax.device_get(run) for run in runs]
        read = jax.tree.map(lambda *parts: np.concatenate([p.reshape(-1, *p.shape[2:]) for p in parts])[:n], *found)
        if not (balanced := np.isfinite(read.patches.normal_force).all(axis=(1, 2))).all():
            i = int(np.argmin(balanced))
            raise UserError(
                f"friction: {given[3][i]:g} drags a wheel down its flange by as much as the rail lifts it at "
                f"{1e3 * given[0][i]:.4g} mm and {1e3 * given[1][i]:.4g} mrad (pose {i}); no normal force balances it"
            )
        return read

    def sentence(self) -> str:
        """What it is worth."""
        place, _, _, creep = self.error
        if not self.jumping < 1:
            return (
                f"All {self.checked} wheels that were looked at between the poses of the table of contacts are near a "
                "jump, where the nearest pose is taken: its error is not known."
            )
        return (f"Between the poses of the table of contacts forces are off by {100 * creep[0]:.2g} % of mu F_N in the "
                f"mean, 95 % of {self.checked} wheels by less than {100 * creep[1]:.2g} %, the largest by "
                f"{100 * creep[2]:.2g} %, and places by at most {1e3 * place[2]:.2g} mm; {100 * self.jumping:.2g} % of "
                "them are near a jump, where the nearest pose is taken.")  # fmt: skip


def _together(
    pose: tuple[ArrayLike, ...], creep: tuple[ArrayLike, ...], load: ArrayLike
) -> tuple[list[Array], Array]:  # fmt: skip
    """Arrays (n,) of the poses, then (n, 2) of creepages; loads (n, 2)."""
    added = [np.asarray(v, float) for v in creep]
    added = [v if v.ndim > 1 else np.atleast_1d(v)[:, None] for v in added]
    try:
        given = list(np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in pose)))
        n = np.broadcast_shapes(given[0].shape, *((len(v),) for v in added))[0]
        each = [np.broadcast_to(v, n) for v in given] + [np.broadcast_to(v, (n, 2)) for v in added]
        return each, np.broadcast_to(np.asarray(load, float), (n, 2))
    except (TypeError, ValueError) as error:
        raise UserError(
            f"lateral, yaw, speed, friction, turning, xi, eta, phi, load: shapes do not go together ({error}); give "
            "(n,) of the poses, and (n, 2) of what differs between the left and the right wheel"
        ) from error


MISSED = ("middle of the contact on the wheel, m", "largest pressure, of its own", "normal force over the load",
          "creep force over mu times the load")  # fmt: skip


def forces(
    table: ContactTable, lateral: Array, yaw: Array, speed: Array, friction: Array, turning: Array, xi: Array,
    eta: Array, phi: Array, load: Array,
) -> WheelForces:  # fmt: skip
    """`ContactTable.forces` as a pure function of arrays (n,) and load (n, 2), for `jax.jit`, `vmap` and `grad`; xi,
    eta and phi are (n,) or (n, 2)."""
    side = jnp.array([-1.0, 1.0])
    weights = _weights(table, lateral[:, None] * side, yaw[:, None])
    patches = _mirrored(Patches(*(_mean(jnp.asarray(v), weights) for v in table.patches)))
    roll = _mean(jnp.asarray(table.roll)[..., None], weights)[..., 0]
    down = _mean(jnp.asarray(table.down)[..., None], weights)[..., 0]
    pose = lateral, yaw, 0.5 * (roll[:, 1] - roll[:, 0]), down.mean(axis=1)
    given = pose, speed, turning, friction, (xi, eta, phi), table.shear, table.poisson, weights[-1]

    def at(more: Array) -> WheelForces:
        more = jnp.where(load > 0, more, 0.0)[..., None]
        wide, force = jnp.cbrt(more), patches.normal_force * more
        a, b, pressure = (v * wide for v in (patches.a, patches.b, patches.pressure))
        return _rolled(patches._replace(a=a, b=b, pressure=pressure, normal_force=force), *given)

    return _balanced(at, jnp.maximum(load, EMPTY), load / table.load)


def _balanced(at: Callable[[Array], WheelForces], load: Array, first: Array) -> WheelForces:
    """Rolling where the wheels carry the load (n, 2), by secants between the logarithms of the normal forces and of the
    lift, which are nearly proportional: the share of a tangential force in the lift changes little. NaN where friction
    takes all the lift away.

    Two steps: to 1e-6 of the load in the mean over the benchmark's flange, 2e-4 at most, with mu = 0.3."""

    def step(of: tuple[Array, ...], _: None) -> tuple[tuple[Array, ...], WheelForces]:
        before, was, x = of
        rolling = at(jnp.exp(x))
        lift = -rolling.felt[..., 2]
        more = jnp.log(jnp.where(load > EMPTY, lift, load) / load)
        slope = (more - was) / jnp.where(x == before, 1.0, x - before)
        slope = jnp.where(jnp.abs(x - before) > 1e-9, jnp.clip(slope, 0.2, 5.0), 1.0)
        return (x, more, x - more / slope), rolling

    begun = jnp.log(jnp.maximum(first, EMPTY))
    start = begun, jnp.zeros_like(begun), begun
    steps = jax.lax.scan(step, start, None, length=SECANTS + 1)[1]
    return WheelForces(*jax.tree.map(lambda v: v[-1], tuple(steps)))


SECANTS = 2


@program
def _rolling(table: ContactTable, *given: Array) -> WheelForces:
    """Of (blocks, n) arrays, block after block."""
    return jax.lax.map(lambda of: forces(table, *of), given)


def _mirrored(p: Patches) -> Patches:
    """Of both wheels, from what they have as right ones."""
    side = np.array([[-1.0], [1.0]])
    return p._replace(ahead=p.ahead * side, y=p.y * side, angle=p.angle * side)


def _rolled(
    p: Patches, pose: tuple[Array, ...], speed: Array, turning: Array, friction: Array, more: tuple[Array, ...],
    shear: Any, poisson: Any, jumps: Array,
) -> WheelForces:  # fmt: skip
    """Creepages as `wheelset.patches` has them, forces of the strips, and what the wheels feel of it."""
    lateral, yaw, roll, down = pose
    each = [v.reshape(len(v), -1, 1) for v in (lateral, yaw, roll, speed, turning, *more)]
    lateral, yaw, roll, speed, turning = each[:5]
    p = p._replace(ahead=p.ahead * jnp.sin(yaw))
    along = p.ahead * jnp.cos(yaw) + (p.y - lateral) * jnp.sin(yaw)
    there, radius = p.normal_force > 0, jnp.where(p.radius > 0, p.radius, 1.0)  # 0 of none
    *rigid, V = creepages(speed, turning, radius, along, yaw, roll, p.angle, jnp)
    xi, eta, phi = (v + added for v, added in zip(rigid, each[5:], strict=True))
    of = xi, eta, phi, *(jnp.where(there, v, 1e-3) for v in (p.a, p.b)), jnp.maximum(p.normal_force, EMPTY)
    flat = [jnp.broadcast_to(v, p.a.shape).ravel() for v in (*of, friction[:, None, None], shear, poisson)]
    creep = strips.forces(strips.poses(*flat))
    creep = strips.CreepForces(*(jnp.where(there, v.reshape(there.shape), 0.0) for v in creep))
    return WheelForces(p, xi, eta, phi, V, creep, _felt(p, creep, lateral, down[:, None, None]), pose[2], down, jumps)


def _felt(p: Patches, creep: strips.CreepForces, lateral: Array, down: Array) -> Array:
    """(n, 2, 6), the sum of what `wheelset.RollingPatch.felt` tells."""
    c, s, none = jnp.cos(p.angle), jnp.sin(p.angle), jnp.zeros_like(p.angle)
    up, left = jnp.stack([none, s, -c], -1), jnp.stack([none, -c, -s], -1)
    x, y, moment = (v[..., None] for v in creep[:3])
    force = x * jnp.array([1.0, 0.0, 0.0]) + y * left + p.normal_force[..., None] * up
    arm = jnp.stack([p.ahead, p.y - lateral, p.z - down], -1)
    return jnp.concatenate([force, jnp.cross(arm, force) + moment * up], -1).sum(axis=-2)


def _weights(table: ContactTable, y: Array, yaw: Array) -> tuple[Array, ...]:
    """First of four shifts and of two yaws, what each counts, (n, 2, 4) and (n, 2, 2), and whether a contact jumps."""
    m, n = table.roll.shape
    place, turn = (y / table.reach[0] + 1) * 0.5 * (n - 1), (yaw / table.reach[1]) ** 2 * (m - 1)
    i, j = (jnp.clip(jnp.floor(v).astype(int), 0, most - 2) for v, most in ((place, n), (turn, m)))
    i, j = jnp.broadcast_arrays(i, j)
    how = jnp.asarray(table.cells)[j, i][..., None]
    first = jnp.clip(i - 1, 0, n - 4)
    u, at = (place - first)[..., None], jnp.arange(4)
    others = (u[..., None] - at) / jnp.where(jnp.eye(4) > 0, 1, at[:, None] - at)
    cubic = jnp.prod(jnp.where(jnp.eye(4) > 0, 1.0, others), axis=-1)
    nearest = jnp.where(at == jnp.clip(jnp.round(u), 0, 3), 1.0, 0.0)
    over = jnp.where(how == 0, cubic, jnp.where(how == 1, jnp.maximum(1 - jnp.abs(u - at), 0.0), nearest))
    t = (turn - j)[..., None]
    between = jnp.concatenate([1 - t, t], -1)
    between = jnp.where(how == 2, jnp.round(jnp.clip(between, 0.0, 1.0)), between)
    return first, j, over, between, how[..., 0] == 2


def _mean(values: Array, weights: tuple[Array, ...]) -> Array:
    """(n, 2, k) of (m, n, k)."""
    first, j, over, between, _ = weights
    near = values[(j[..., None] + jnp.arange(2))[..., :, None], (first[..., None] + jnp.arange(4))[..., None, :]]
    return jnp.einsum("nsjik,nsj,nsi->nsk", near, between, over)


@arguments.checked
def contact_table(
    track: Track, load: Positive, lateral: Positive, yaw: Positive, *, points: Annotated[Any, wholes(4, 2)] = POINTS,
    checked: Count = 100, seed: Index = 0, report: Report = lambda _: None,
) -> ContactTable:  # fmt: skip
    """A table over poses, and its error at random ones.

    Args:
        load: vertical, on each wheel, N. lateral, yaw: reach to either side, m and rad. points: of the shift to one
            side from 0, and of the yaw. checked: poses. report: told every tenth of the work.

    Raises:
        UserError: a pose in which the profiles do not touch, or touch where one ends; numbers that are none.
    """
    shifts, turns = np.linspace(0.0, lateral, points[0]), yaw * np.sqrt(np.linspace(0.0, 1.0, points[1]))
    turns[0] = LEAST * yaw
    p, roll, down = _found(track, load, np.tile(shifts, points[1]), np.repeat(turns, points[0]), report=report)
    by_yaw = [v.reshape(*points[::-1], *v.shape[1:]) for v in (*p, roll, down)]
    *sides, roll, down = by_yaw
    whole = Patches(*(np.concatenate([v[:, :0:-1, 0], v[:, :, 1]], axis=1) for v in sides))
    roll, down = (np.hstack([sign * v[:, :0:-1], v]) for sign, v in ((-1.0, roll), (1.0, down)))
    e, none = track.elastic, np.full((len(MISSED), 3), np.nan)
    reach = np.array([lateral, yaw])
    table = ContactTable(reach, load, track.radius, e.shear, e.poisson, whole, roll, down, _cells(whole), none, 0, 0.0)
    return _judged(table, track, checked, seed)


LEAST = 1e-3
"""Of the reach of the yaw: stands for 0 in its square, and tells x over its sine."""


def _found(
    track: Track, load: float, lateral: Array, yaw: Array, rolls: Array | None = None, friction: float = 0.0,
    report: Report = lambda _: None,
) -> tuple[Patches, Array, Array]:  # fmt: skip
    """`Patches` (n, 2, k) of n poses, both as right wheels, the left one's of the mirrored pose; roll and down (n,)."""
    found, roll = [], 0.0
    for k, (y, turn) in enumerate(zip(lateral, yaw, strict=True)):
        if k % -(-len(lateral) // 10) == 0:
            report(f"table of contacts: {k} of {len(lateral)} poses")
        try:
            near = Pose(y, turn, roll if rolls is None else rolls[k])
            left, right, pose = axle(track, near, 2 * load, even=True, friction=friction)
        except UserError as error:
            at = f"at {1e3 * y:.4g} mm of lateral shift and {1e3 * turn:.4g} mrad of yaw"
            raise UserError(f"{at}: {error}; or take a smaller reach of the table") from error
        roll = pose.roll
        found.append((left, right, pose))
    many = max(len(side) for one in found for side in one[:2])
    rows = [
        [_row(track, side, sign, pose.yaw, many) for side, sign in ((left, -1.0), (right, 1.0))]
        for left, right, pose in found
    ]
    patches = Patches(*np.moveaxis(np.array(rows), 2, 0))
    return patches, np.array([pose.roll for *_, pose in found]), np.array([right[0].axle[1] for _, right, _ in found])


def _row(track: Track, found: list[RollingPatch], sign: float, yaw: float, many: int) -> Array:
    """(fields, k) of a wheel."""
    out = np.zeros((len(Patches._fields), many))
    for k, p in enumerate(sorted(found, key=lambda p: -p.on_wheel)):
        radius = track.radius + float(track.wheel.height(p.on_wheel))
        x, y, z = p.place
        out[:, k] = [sign * x / np.sin(yaw), sign * y, z, p.on_rail, p.on_wheel, radius, sign * p.angle, p.a, p.b,
                     p.pressure, p.normal_force]  # fmt: skip
    return out


def _cells(p: Patches) -> Array:
    """How each cell is read: a patch that goes on overlaps with itself from corner to corner."""
    there = p.normal_force > 0

    def goes_on(first: Any, second: Any) -> Array:
        near = np.abs(p.on_wheel[first] - p.on_wheel[second]) <= p.b[first] + p.b[second]
        return ((there[first] == there[second]) & near).all(axis=-1)

    over, turned = goes_on(np.s_[:, 1:], np.s_[:, :-1]), goes_on(np.s_[1:], np.s_[:-1])
    whole = over[1:] & over[:-1] & turned[:, 1:] & turned[:, :-1]
    first = np.clip(np.arange(whole.shape[1]) - 1, 0, whole.shape[1] - 3)
    return np.where(whole[:, first] & whole[:, first + 1] & whole[:, first + 2], 0, np.where(whole, 1, 2))


def _judged(table: ContactTable, track: Track, checked: int, seed: int) -> ContactTable:
    """With its error at random poses."""
    lateral, yaw = np.random.default_rng(seed).uniform(-1, 1, size=(2, checked)) * table.reach[:, None]
    ones, none = np.ones(checked), np.zeros(checked)
    read = table.forces(lateral, yaw, ones, MU)
    if read.jumps.all():
        return table._replace(checked=2 * checked, jumping=1.0)
    p, roll, down = _found(track, table.load, lateral, yaw, read.roll, MU)
    pose, free = (lateral, yaw, roll, down), ones / table.radius
    exact = _exact(_mirrored(p), pose, ones, free, MU * ones, (none,) * 3, table.shear, table.poisson, read.jumps)
    exact = jax.device_get(exact)
    quantities = [_told(of, table.load) for of in (read, exact)]
    off = [np.abs(v - w) for v, w in zip(*quantities, strict=True)]
    off[1] /= quantities[1][1]
    off[3] = off[3].max(axis=-1)
    good = np.array([v[~read.jumps] for v in off])
    error = np.stack([good.mean(axis=1), np.quantile(good, 0.95, axis=1), good.max(axis=1)], axis=1)
    return table._replace(error=error, checked=2 * checked, jumping=float(read.jumps.mean()))


MU = 0.3
"""Of the creep forces of `MISSED`."""

_exact = program(_rolled)


def _told(r: WheelForces, load: float) -> list[Array]:
    """Of `MISSED`, (n, 2, ...): whatever the order of the patches."""
    p, total = r.patches, r.patches.normal_force.sum(axis=-1)
    creep = np.stack([r.creep.x, r.creep.y], axis=-1).sum(axis=-2) / (MU * load)
    middle = (p.normal_force * p.on_wheel).sum(axis=-1) / total
    return [middle, p.pressure.max(axis=-1), total / load, creep]


FORMAT = "microslip-contact-table-1"


@arguments.checked
def write_contact_table(path: Path | str, table: ContactTable) -> Path:
    """As HDF5: a dataset an attribute, those of its patches in a group; complete or not at all."""
    arrays = {name: value for name, value in table._asdict().items() if name != "patches"}
    arrays |= {f"patches/{name}": value for name, value in table.patches._asdict().items()}
    told = {"meaning": str(ContactTable.__doc__), "patches": str(Patches.__doc__), "missed": ", ".join(MISSED)}
    return write_table(path, arrays, format=FORMAT, **told)


@arguments.checked
def read_contact_table(path: Path | str) -> ContactTable:
    """A table that `write_contact_table` wrote.

    Raises:
        UserError: another file.
    """
    of_wheels = [name for name in ContactTable._fields if name != "patches"]
    names = [*of_wheels, *(f"patches/{name}" for name in Patches._fields)]
    arrays, _ = read_table(path, names, FORMAT, "write a table of contacts with [contacts] in a case")
    patches = Patches(*(arrays[f"patches/{name}"] for name in Patches._fields))
    rest: dict[str, Any] = {name: arrays[name] for name in of_wheels}
    return ContactTable(patches=patches, **rest)
