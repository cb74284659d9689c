"""What a contact does, as tables: force over approach, loops, orbits, friction over speed, microslip, wear, limits.

Every table is a CSV of `microslip contact`, and the picture of the same name is drawn from its columns alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from .. import plausible
from ..errors import UserError, in_its_file
from ..programs import program
from . import microslip
from . import settings as S
from .composed import ContactModel, compose
from .friction import FASTEST, OfLubricated, coefficients, lubricated, smoothed
from .jenkins import Jenkins
from .law import history, values
from .layer import Layer, quasi_static_error
from .normal import Preload, Rough
from .point import PointContact
from .regularised import MassContact, integrate
from .set_valued import REFUSED
from .sliders import Strips
from .solids import Solid
from .stiffness import OfCurve
from .wear import course, dimensionless_time, from_archard, from_energy_density

Columns = dict[str, np.ndarray]
OPEN, STICK, SLIP = 0, 1, 2
CREEP = 10.0
"""A smoothed contact counts as slipping where slope times speed is more: friction has 94 % of its value there."""


@dataclass(frozen=True)
class Study:
    """What a contact does.

    Attributes:
        contact: the laws. tables: name -> columns, whose names end with the unit; see `docs/contact.md`. told: rows
            (what, value) of the short table. sentences: judgements: yield, limit of application.
        working: approach, m, and normal force, N, of the working point; None if the file has none.
    """

    contact: ContactModel
    tables: dict[str, Columns]
    told: list[tuple[str, str]]
    sentences: list[str]
    working: tuple[float, float] | None = None


@dataclass
class _Findings:
    tables: dict[str, Columns] = field(default_factory=dict)
    told: list[tuple[str, str]] = field(default_factory=list)
    sentences: list[str] = field(default_factory=list)


@in_its_file
def study(path: Path | str, assignments: list[str] | None = None) -> Study:
    """Read a contact file and compute all that it gives what is needed for.

    Raises:
        UserError: every mistake, with file and key. NotConverged: an element that could not be integrated.
    """
    settings = S.load_contact(path, assignments)
    if settings.what.rigid:
        raise UserError(REFUSED)
    pressed = settings.motion.normal_force if settings.motion else None
    contact = compose(settings, Path(path), pressed or 0.0)
    found, working = _Findings(), _working(contact)
    _normal(contact, working, found)
    if contact.friction is not None:
        _characteristic(contact, working, found)
    if contact.file.motion is not None and contact.law is not None:
        _motion(contact, working, found)
    if contact.file.microslip is not None:
        _first_loading(contact, contact.file.microslip, found)
    if contact.file.wear is not None:
        _wear(contact, found)
    _limits(contact, found)
    found.sentences += moduli_doubted("", settings)
    return Study(contact, found.tables, found.told, found.sentences, working)


def moduli_doubted(where: str, law: S.ContactLaw) -> list[str]:
    """What is said of moduli that no solid has. where: that they stand in, with a dot."""
    keys = ("young", "young_2")
    given = [(key, getattr(law.stiffness, key, None)) for key in keys]
    told = [plausible.modulus(f"{where}stiffness.{key}", E) for key, E in given if E is not None]
    return [text for text in told if text]


# working point and normal law --------------------------------------------------------------------------------------


def _working(c: ContactModel) -> tuple[float, float] | None:
    """Approach and force of the static state."""
    motion = c.file.motion
    if motion is None:
        return None
    if motion.normal_force is not None and isinstance(c.law, Strips):  # a little away from the smooth law
        return float(c.law.approach(motion.normal_force)), motion.normal_force
    if motion.normal_force is not None:
        return approach_under(c, motion.normal_force), motion.normal_force
    return motion.normal[0], float(values(c.normal, "force", motion.normal[0]))


def approach_under(c: ContactModel, force: float) -> float:
    """Approach (m) at a normal force (N), by bisection down to rounding."""
    low, high = -1e-9, force / c.normal_0 + (c.roughness or 1e-6)
    for _ in range(200):
        if values(c.normal, "force", high) >= force:
            break
        high *= 2
    else:
        raise UserError(f"{force:g} N is more than the normal law reaches; lower it", "motion.normal_force")
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if values(c.normal, "force", middle) < force else (low, middle)
    return high


def _normal(c: ContactModel, working: tuple[float, float] | None, found: _Findings) -> None:
    if c.stiffness is not None:
        t1, t2 = c.stiffness.tangential
        both = _engineering(t1, "N/m") if t1 == t2 else f"{_engineering(t1, 'N/m')} and {_engineering(t2, 'N/m')}"
        found.told.append(("stiffness of the full area, tangential", both))
        found.told.append(("it counts", c.stiffness.includes.replace("+", " and ")))
    found.told.insert(0, ("stiffness of the full area, normal", _engineering(c.normal_0, "N/m")))
    if c.roughness is not None:
        found.told.append(("roughness R_Z", _engineering(c.roughness, "m")))
    if isinstance(c.normal, Preload):
        found.told.append(("normal force, constant", f"{float(c.normal.constant):.4g} N"))
        return
    u = np.linspace(*_reach(c, working), 401)
    force, stiffness, share = (values(c.normal, what, u) for what in ("force", "stiffness", "share"))
    table = {"approach_m": u, "force_N": force, "normal_stiffness_N/m": stiffness}
    if c.stiffness is not None:
        for name, k in zip(("t1", "t2"), c.stiffness.tangential, strict=True):
            table[f"tangential_stiffness_{name}_N/m"] = k * share
    found.tables["normal"] = {**table, "area_share": share if c.heights is None else _area(c, u)}
    if working is not None:
        _at_working_point(c, working, found)


def _at_working_point(c: ContactModel, working: tuple[float, float], found: _Findings) -> None:
    u = working[0]
    share = float(values(c.normal, "share", u))
    found.told.append(("working point", f"{_engineering(working[0], 'm')}, {_engineering(working[1], 'N')}"))
    found.told.append(("normal stiffness there", _engineering(float(values(c.normal, "stiffness", u)), "N/m")))
    if c.stiffness is not None:
        found.told.append(("tangential stiffness there", _engineering(c.stiffness.tangential[0] * share, "N/m")))
    if c.roughness is not None:
        touching = 100 * float(_area(c, np.array(u)))
        found.told.append(("share of the area in contact there", f"{touching:.4g} %"))


def _area(c: ContactModel, u: np.ndarray) -> np.ndarray:
    """Share of the nominal area in contact at approaches (m), between 0 and 1."""
    if c.heights is None or c.roughness is None:
        return np.clip(values(c.normal, "share", u), 0.0, 1.0)
    return values(c.heights, "area", u / c.roughness)


def _reach(c: ContactModel, working: tuple[float, float] | None) -> tuple[float, float]:
    """Approaches that show the law: a little open, and beyond the full area or the motion."""
    motion = c.file.motion
    top = 0.0 if c.roughness is None else 1.4 * c.roughness
    if motion is not None and working is not None:
        top = max(top, 1.1 * (working[0] + sum(map(abs, motion.normal[1:]))))
    if isinstance(c.settings.stiffness, OfCurve):
        knots = np.asarray(c.normal.u)  # type: ignore[attr-defined]
        return float(knots[0] - 0.05 * np.ptp(knots)), float(max(top, knots[-1]))
    top = top if top > 0 else 1e-5
    return -0.15 * top, top


# friction over the speed -------------------------------------------------------------------------------------------


def _characteristic(c: ContactModel, working: tuple[float, float] | None, found: _Findings) -> None:
    assert c.friction is not None
    if isinstance(c.settings.friction, OfLubricated):
        return _lubricated(c, c.settings.friction, found)
    pressed = working[1] if working is not None and working[1] > 0 else 1.0
    speeds = c.friction.speeds_shown(pressed)
    table = {"speed_m/s": speeds, **c.friction.columns(speeds, pressed)}
    if isinstance(c.law, MassContact):
        table["smoothed"] = table["coefficient"] * np.array(smoothed(jax.device_put(speeds), c.law.slope))
    found.tables["friction"] = table


def _lubricated(c: ContactModel, given: OfLubricated, found: _Findings) -> None:
    """Dry and fluid part over the speed at four approaches (Fig. 3.6-5)."""
    heat = c.settings.temperature
    assert heat is not None and c.heights is not None and c.roughness is not None and c.area is not None
    one = given.mu_0 * heat.resistance * c.roughness * c.normal_0 / (heat.limit * c.area)  # v* per m/s (3.6-22)
    eta = c.area**2 * heat.limit / (heat.resistance * given.mu_0**2 * c.normal_0**2 * c.roughness**3) * given.viscosity
    v, approaches = np.linspace(0, min(10, FASTEST * one), 201), np.array([0.4, 0.6, 0.8, 1.0])
    dry, fluid = lubricated(c.heights, approaches, v, eta, given.film)
    found.tables["friction"] = {
        "approach_m": np.repeat(approaches * c.roughness, len(v)), "speed_m/s": np.tile(v / one, len(approaches)),
        "coefficient": given.mu_0 * (dry + fluid).ravel(), "dry_part": given.mu_0 * dry.ravel(),
    }  # fmt: skip
    found.told.append(("smallest film over R_Z, where the fluid part is cut off", f"{given.film:g}"))


# motion ------------------------------------------------------------------------------------------------------------


def _motion(c: ContactModel, working: tuple[float, float] | None, found: _Findings) -> None:
    motion = c.file.motion
    assert motion is not None and working is not None and c.friction is not None and c.law is not None
    time = np.arange(motion.cycles * motion.samples + 1) / (motion.samples * motion.frequency)
    path = _path(motion, working[0])
    amplitudes = _amplitudes(c, working)
    u = np.asarray(_displacements(*path.args, time))
    loops = _loop_paths(amplitudes, working[0], motion, time)
    if isinstance(c.law, MassContact):
        told = integrate(c.law, path, time)
        force, slip, speed = told.force, told.point, told.velocity
        slips = np.linalg.norm(speed, axis=1) * float(c.law.slope) > CREEP
        loop_force = np.asarray(history(c.law, loops, time[1]).force) if len(amplitudes) else loops
    else:
        done = history(c.law, np.concatenate([u[:, None], loops], axis=1), time[1])
        force, slip, loop_force = np.asarray(done.force[:, 0]), np.array(done.slip[:, 0]), np.asarray(done.force[:, 1:])
        slips, speed = _slips(c, force, slip, time), np.gradient(slip, time, axis=0)
    apart = (force[:, 0] <= 0) & c.settings.what.opens
    state = np.where(apart, OPEN, np.where(slips, SLIP, STICK))
    table = {"time_s": time}
    for i, name in enumerate(("n", "t1", "t2")):
        table[f"u_{name}_m"] = u[:, i]
    for i, name in enumerate(("n", "t1", "t2")):
        table[f"F_{name}_N"] = force[:, i]
    point = _point(c, u, force, slip, float(time[1]))
    for i, name in enumerate(("t1", "t2")):
        table |= {f"P_{name}_m": point[:, i], f"v_P_{name}_m/s": speed[:, i]}
    table["state"] = state.astype(float)
    found.tables["motion"] = table
    if len(amplitudes):
        found.tables["loops"] = _loop_table(amplitudes, loops, loop_force, motion)
    _of_a_cycle(c, working, u, force, state, motion, found)


def _point(c: ContactModel, u: np.ndarray, force: np.ndarray, slip: np.ndarray, dt: float) -> np.ndarray:
    """(s, 2) place of P, m: M less the stretch e of the springs (the mean over the area in contact), which follows
    from force = share k (e + beta e'); where the contact is open the springs are released and P stands at M.

    In the book's form the stretch stays when the contact opens: P slides in contact, and moves with M in the open.
    """
    share = values(c.normal, "share", u[:, 0])
    assert c.stiffness is not None
    place = np.array(u[:, 1:])
    if isinstance(c.law, MassContact) and c.law.printed:
        for k in range(1, len(u)):
            place[k] = place[k - 1] + (u[k, 1:] - u[k - 1, 1:] if share[k] <= 0 else slip[k] - slip[k - 1])
        return place
    pull = force[:, 1:] / (np.maximum(share, 1e-300)[:, None] * np.array(c.stiffness.tangential))
    lag = float(getattr(c.law, "damping", None) or 0.0) / dt
    stretch = np.zeros(2)
    for k in range(len(u)):
        stretch = (pull[k] + lag * stretch) / (1 + lag) if share[k] > 1e-9 else np.zeros(2)
        place[k] -= stretch
    return place


def _path(motion: S.Motion, mean: float) -> partial[jax.Array]:
    """Displacement (3,) in m over the time in s."""
    rows = [(mean, *motion.normal[1:]), motion.t1, motion.t2]
    most = max(map(len, rows)) | 1  # a missing last sine is zero
    table = np.array([[*row, *[0.0] * (most - len(row))] for row in rows])
    return partial(_displacement, table, np.array([0.0, motion.drift, 0.0]), 2 * np.pi * motion.frequency)


def _displacement(table: np.ndarray, drift: np.ndarray, omega: float, t: jax.Array) -> jax.Array:
    orders = range(1, table.shape[1] // 2 + 1)
    waves = [jnp.ones(())] + [f(h * omega * t) for h in orders for f in (jnp.cos, jnp.sin)]
    return table @ jnp.stack(waves) + drift * t


_displacements = program(jax.vmap(_displacement, (None, None, None, 0)))


def _amplitudes(c: ContactModel, working: tuple[float, float]) -> tuple[float, ...]:
    """Of the hysteresis loops: those of the file, or about the displacement at which a stuck contact slides."""
    motion = c.file.motion
    assert motion is not None and c.friction is not None and c.stiffness is not None
    if motion.amplitudes or motion.drift:
        return motion.amplitudes
    share = float(values(c.normal, "share", working[0]))
    mu = float(coefficients(c.friction, 0.0, working[1])[0])
    if working[1] <= 0 or share <= 0 or mu <= 0:
        return ()
    slides = mu * working[1] / (c.stiffness.tangential[0] * share)
    return tuple(slides * factor for factor in (0.5, 1.5, 3.0, 5.0))


def _loop_paths(amplitudes: tuple[float, ...], mean: float, motion: S.Motion, time: np.ndarray) -> np.ndarray:
    """(s, a, 3) m: along t1, pressed as at the working point, from the middle on."""
    loops = np.zeros((len(time), len(amplitudes), 3))
    loops[..., 0] = mean
    loops[..., 1] = np.sin(2 * np.pi * motion.frequency * time)[:, None] * np.array(amplitudes)
    return loops


def _loop_table(amplitudes: tuple[float, ...], u: np.ndarray, force: np.ndarray, motion: S.Motion) -> Columns:
    """First loading and the last cycle, one amplitude after the other."""
    first, last = slice(0, motion.samples // 4 + 1), slice(len(u) - motion.samples - 1, None)
    rows = np.concatenate([np.arange(len(u))[first], np.arange(len(u))[last]])
    part = np.concatenate([np.zeros(len(np.arange(len(u))[first])), np.ones(motion.samples + 1)])
    a = len(amplitudes)
    return {
        "amplitude_m": np.repeat(amplitudes, len(rows)), "cycle": np.tile(part, a),
        "u_t1_m": u[rows, :, 1].T.ravel(), "F_t1_N": force[rows, :, 1].T.ravel(),
        "dissipated_J": np.repeat([_work(u[last, i], force[last, i]) for i in range(a)], len(rows)),
    }  # fmt: skip


def _work(u: np.ndarray, force: np.ndarray) -> float:
    """Integral of force . du over a path (s, 3), J."""
    return float(0.5 * np.sum((force[1:] + force[:-1]) * np.diff(u, axis=0)))


def _slips(c: ContactModel, force: np.ndarray, slip: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(s,) whether P slides: of sliders in parallel, whether all of them do."""
    assert c.friction is not None
    if isinstance(c.law, PointContact | Jenkins):
        moved = np.linalg.norm(np.diff(slip, axis=0, prepend=slip[:1]), axis=1)
        return moved > 1e-9 * max(float(np.ptp(slip, axis=0).max()), 1e-300)
    held = coefficients(c.friction, 0.0, force[:, 0]) * force[:, 0]
    return np.hypot(force[:, 1], force[:, 2]) > (1 - 1e-6) * held


def _of_a_cycle(
    c: ContactModel, working: tuple[float, float], u: np.ndarray, force: np.ndarray, state: np.ndarray,
    motion: S.Motion, found: _Findings,
) -> None:  # fmt: skip
    last = slice(len(u) - motion.samples - 1, None)
    assert c.friction is not None
    mu = float(coefficients(c.friction, 0.0, max(working[1], 0.0))[0])
    found.told.append(("slip limit at the working point", _engineering(mu * max(working[1], 0.0), "N")))
    what = "energy dissipated in the last cycle" if not motion.drift else "work of friction in the last period"
    found.told.append((what, _engineering(_work(u[last], force[last]), "J")))
    shares = [100 * float(np.mean(state[last][1:] == s)) for s in (STICK, SLIP, OPEN)]
    words = "stick or partly slip / slip / open" if c.settings.what.partly else "stick / slip / open"
    found.told.append((f"{words}, of the last cycle", " / ".join(f"{s:.3g} %" for s in shares)))
    if shares[2] == 100:
        found.sentences.append("The contact never closes in the last cycle: raise the mean of motion.normal.")


# microslip ---------------------------------------------------------------------------------------------------------


def _first_loading(c: ContactModel, given: S.Microslip, found: _Findings) -> None:
    """Tangential force over displacement (3.8), one curve an approach or a normal force."""
    assert c.heights is not None and c.roughness is not None and c.area is not None and c.stiffness is not None
    mu = given.mu if given.mu is not None else getattr(c.settings.friction, "mu", 0.0)
    heat, R = c.settings.temperature, c.roughness
    curve = microslip.of(
        c.heights, c.normal_0, c.stiffness.tangential[0], c.area, R, mu, given.speed,
        given.yield_shear if given.yield_shear is not None else np.inf,
        heat.limit if heat is not None else np.inf, heat.resistance if heat is not None else 0.0, R,
    )  # fmt: skip
    if given.normal_forces:
        u = np.asarray(curve.approach(np.array(given.normal_forces) / (c.normal_0 * R)))
    else:
        u = np.array(given.approaches or tuple(R * x for x in (0.25, 0.5, 0.75, 1.0, 1.25))) / R
    slides = mu * c.normal_0 / c.stiffness.tangential[0]  # displacement over approach at which all of it slides, cold
    top = given.displacement / R if given.displacement is not None else 1.25 * slides * float(u.max())
    w = np.linspace(0.0, top, 401)
    force, warm = (np.array([f(w, one) for one in u]) for f in (curve.force, curve.temperature))
    loads = c.normal_0 * R * np.asarray(curve.normal_force(u))
    table = {
        "approach_m": np.repeat(R * u, len(w)), "normal_force_N": np.repeat(loads, len(w)),
        "displacement_m": np.tile(R * w, len(u)), "F_t_N": mu * c.normal_0 * R * force.ravel(),
    }  # fmt: skip
    table["coefficient"] = table["F_t_N"] / table["normal_force_N"]
    if heat is not None:
        table["temperature_rise_K"] = heat.limit * warm.ravel()
    found.tables["microslip"] = table
    last = table["coefficient"].reshape(len(u), -1)
    found.told.append(("equivalent friction coefficient at the end of loading", f"{last[:, -1].min():.4g} to "
                       f"{last[:, -1].max():.4g}, at most {last.max():.4g}"))  # fmt: skip


# wear --------------------------------------------------------------------------------------------------------------

SHOWN = 6
"""Height distributions drawn over the course of wear."""


def _wear(c: ContactModel, found: _Findings) -> None:
    given = c.file.wear
    assert given is not None and c.heights is not None and c.roughness is not None and c.area is not None
    mu = given.mu if given.mu is not None else _sliding_friction(c, given)
    law = Rough(c.normal_0, c.roughness, c.heights)  # type: ignore[arg-type]
    time = given.time * np.linspace(0, 1, 201) ** 2  # the beginning is the fastest
    energy = mu * given.normal_force * given.speed * time
    coefficient = _wear_coefficient(given, mu)
    stars = dimensionless_time(energy, coefficient, law, c.area, np.asarray(given.normal_force))
    worn = course(c.heights, given.normal_force / (c.normal_0 * c.roughness), stars)
    scale = c.normal_0 * c.roughness / c.area
    share = worn.area
    found.tables["wear"] = {
        "time_s": time, "dimensionless_time": stars, "approach_m": c.roughness * worn.approach, "area_share": share,
        "largest_pressure_Pa": scale * worn.pressure.max(axis=1), "peak_to_valley_m": c.roughness * worn.roughness,
        "normal_stiffness_N/m": c.normal_0 * share, "worn_volume_m3": coefficient * energy,
    }  # fmt: skip
    rows = [int(np.argmin(np.abs(time - t))) for t in np.linspace(0, 1, SHOWN) ** 2 * given.time]
    found.tables["wear_heights"] = {
        "time_s": np.repeat(time[rows], len(worn.share)), "area_share": np.tile(worn.share, SHOWN),
        "depth_m": c.roughness * worn.depth[rows].ravel(), "pressure_Pa": scale * worn.pressure[rows].ravel(),
    }  # fmt: skip
    found.told.append(("worn volume", _engineering(1e9 * coefficient * energy[-1], "mm³")))
    found.told.append(("area in contact, new and worn", f"{100 * share[0]:.4g} % and {100 * share[-1]:.4g} %"))


def _sliding_friction(c: ContactModel, given: S.Wear) -> float:
    assert c.friction is not None
    mean = c.friction.without_scatter()
    return float(coefficients(mean, given.speed, given.normal_force)[0])


def _wear_coefficient(given: S.Wear, mu: float) -> float:
    """I_W, m3/J."""
    if given.archard is not None and given.hardness is not None:
        return from_archard(given.archard, given.hardness, mu)
    return given.coefficient if given.coefficient is not None else from_energy_density(given.energy_density or 0.0)


# limits ------------------------------------------------------------------------------------------------------------


def _limits(c: ContactModel, found: _Findings) -> None:
    motion, limits = c.file.motion, c.file.limits
    if motion is not None:
        if c.layer is not None and c.layer.density is not None:
            found.sentences.append(c.layer.quasi_static(motion.frequency, limits.tolerance).sentence())
        elif isinstance(c.law, MassContact):
            found.sentences.append(_element_margin(c.law, motion.frequency, limits.tolerance))
    if limits.yield_shear is not None and c.area is not None and "motion" in found.tables:
        _yields(c, limits.yield_shear, found)


def _element_margin(law: MassContact, frequency: float, tolerance: float) -> str:
    """(3.7-45): the mass element's own frequency sqrt(c_R0/m) far above that of the motion."""
    own = float(np.sqrt(np.asarray(law.stiffness_1) / np.asarray(law.mass))) / (2 * np.pi)
    error = quasi_static_error(frequency / own)
    verdict = "may" if error <= tolerance else "must not"
    return (
        f"At {frequency:.4g} Hz the contact element {verdict} be used: its own frequency is {own:.4g} Hz, so the layer "
        f"it stands for is {100 * error:.2g} % too stiff there; {100 * tolerance:.2g} % are allowed."
    )


def _yields(c: ContactModel, yield_shear: float, found: _Findings) -> None:
    """Tresca at the mean pressure and shear of the area in contact, at every sample of the last cycle."""
    table, motion = found.tables["motion"], c.file.motion
    assert motion is not None and c.area is not None
    last = slice(len(table["time_s"]) - motion.samples - 1, None)
    share = _area(c, table["u_n_m"][last])
    area = c.area * np.maximum(share, 1e-12)
    force = [np.where(share > 0, table[f"F_{name}_N"][last], 0.0) / area for name in ("n", "t1", "t2")]
    pressure, shear = np.maximum(force[0], 0.0), np.stack(force[1:], axis=1)
    layer = c.layer or Layer(Solid(2.1e11, 0.3), 1.0, c.file.limits.boundary)
    time = table["time_s"][last]
    names = [f"t = {t:.4g} s of the cycle" for t in time - time[0]]
    check = layer.check_yield(pressure, shear, yield_shear, names=names)
    found.tables["yield"] = {
        "time_s": time, "pressure_Pa": pressure, "shear_t1_Pa": shear[:, 0], "shear_t2_Pa": shear[:, 1],
        "share_of_yield": check.utilisation,
    }  # fmt: skip
    found.sentences.append(check.sentence(1))


# numbers -----------------------------------------------------------------------------------------------------------

_PREFIX = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def _engineering(value: float, unit: str) -> str:
    """A number with a prefix that leaves one to three digits before the point; stiffnesses as the file has them."""
    if unit in ("N/m", "mm³") or value == 0 or not np.isfinite(value):
        return f"{value:.4g} {unit}"
    factor, prefix = next((p for p in _PREFIX if abs(value) >= 0.99995 * p[0]), _PREFIX[-1])
    return f"{value / factor:.4g} {prefix}{unit}"
