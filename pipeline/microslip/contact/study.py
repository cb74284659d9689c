"""What a contact does, as tables: force over approach, loops, orbits, friction over speed, microslip, wear, limits.

Every table is a CSV of `microslip contact`, and the picture of the same name is drawn from its columns alone.
"""

from __future__ import annotations

import re
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
from .normal import Hyperbolic, Preload, Rough
from .point import PointContact
from .regularised import MassContact, integrate
from .set_valued import REFUSED
from .sliders import Strips
from .solids import Solid, bisected
from .stiffness import OfCurve
from .wear import course, dimensionless_time, from_archard, from_energy_density

Columns = dict[str, np.ndarray]
OPEN, STICK, SLIP = 0, 1, 2
CREEP = 10.0
"""A smoothed contact counts as slipping where slope times speed is more: friction has 94 % of its value there."""

AXES = ("n", "t1", "t2")


@dataclass
class Study:
    """What a contact does; its methods add what is computed, a section of the file each.

    Attributes:
        contact: the laws. tables: name -> columns, whose names end with the unit; see `docs/contact.md`. told: rows
            (what, value) of the short table. sentences: judgements: yield, limit of application.
        working: approach, m, and normal force, N, of the working point; None if the file has none.
    """

    contact: ContactModel
    tables: dict[str, Columns] = field(default_factory=dict)
    told: list[tuple[str, str]] = field(default_factory=list)
    sentences: list[str] = field(default_factory=list)
    working: tuple[float, float] | None = None

    @property
    def written(self) -> dict[str, Columns]:
        """The tables as they are written: names of columns of a dimensionless file end with no unit."""
        if not self.contact.file.dimensionless:
            return self.tables
        return {
            table: {re.sub(r"_(m|N|s|J|Pa|N/m|m/s|m3|K)$", "", name): values for name, values in of.items()}
            for table, of in self.tables.items()
        }

    def _sized(self, value: float, unit: str) -> str:
        return f"{value:.4g}" if self.contact.file.dimensionless else _engineering(value, unit)

    # normal law ------------------------------------------------------------------------------------------------------

    def normal(self) -> None:
        """The normal law, and the stiffnesses at the working point."""
        c, told = self.contact, self.told
        told.append(("stiffness of the full area, normal", self._sized(c.normal_0, "N/m")))
        if c.stiffness is not None:
            both = " and ".join(self._sized(t, "N/m") for t in dict.fromkeys(c.tangential))
            told.append(("stiffness of the full area, tangential", both))
            told.append(("it counts", c.stiffness.includes.replace("+", " and ")))
        if c.roughness is not None:
            told.append(("roughness R_Z", self._sized(c.roughness, "m")))
        if isinstance(c.normal, Preload):
            told.append(("normal force, constant", self._sized(float(c.normal.constant), "N")))
            return
        u = np.linspace(*self._reach(), 401)
        force, stiffness, share = (values(c.normal, what, u) for what in ("force", "stiffness", "share"))
        table = {"approach_m": u, "force_N": force, "normal_stiffness_N/m": stiffness}
        if c.stiffness is not None:
            for name, k in zip(AXES[1:], c.tangential, strict=True):
                table[f"tangential_stiffness_{name}_N/m"] = k * share
        area = share if c.heights is None else self._area(u)
        self.tables["normal"] = {**table, "area_share": area}
        if self.working is not None:
            self._at_working_point(*self.working)

    def _at_working_point(self, approach: float, force: float) -> None:
        c, told = self.contact, self.told
        share, stiffness = (float(values(c.normal, what, approach)) for what in ("share", "stiffness"))
        told.append(("working point", f"{self._sized(approach, 'm')}, {self._sized(force, 'N')}"))
        told.append(("normal stiffness there", self._sized(stiffness, "N/m")))
        if c.stiffness is not None:
            told.append(("tangential stiffness there", self._sized(c.tangential[0] * share, "N/m")))
        if c.roughness is not None:
            touching = 100 * float(self._area(np.array(approach)))
            told.append(("share of the area in contact there", f"{touching:.4g} %"))

    def _area(self, u: np.ndarray) -> np.ndarray:
        """Share of the nominal area in contact at approaches (m), between 0 and 1."""
        c = self.contact
        if c.heights is None or c.roughness is None:
            return np.clip(values(c.normal, "share", u), 0.0, 1.0)
        return values(c.heights, "area", u / c.roughness)

    def _reach(self) -> tuple[float, float]:
        """Approaches that show the law: a little open, and beyond the full area or the motion."""
        c = self.contact
        top = 1.4 * (c.roughness or 0.0)
        if c.file.motion is not None and self.working is not None:
            top = max(top, 1.1 * (self.working[0] + sum(map(abs, c.file.motion.normal[1:]))))
        if isinstance(c.normal, Hyperbolic):  # as far as the law is used: behind that it is a straight line
            top = min(top, (1 - float(c.normal.shortest)) * float(c.normal.length))
        if isinstance(c.settings.stiffness, OfCurve):
            knots = np.asarray(c.normal.u)  # type: ignore[attr-defined]
            return float(knots[0] - 0.05 * np.ptp(knots)), float(max(top, knots[-1]))
        top = top if top > 0 else 1e-5
        return -0.15 * top, top

    # friction over the speed -----------------------------------------------------------------------------------------

    def characteristic(self) -> None:
        """Friction over the speed, at the working point's force."""
        c = self.contact
        if isinstance(c.settings.friction, OfLubricated):
            return self._lubricated(c.settings.friction)
        pressed = self.working[1] if self.working is not None and self.working[1] > 0 else 1.0
        speeds = c.sliding.speeds_shown(pressed)
        table = {"speed_m/s": speeds, **c.sliding.columns(speeds, pressed)}
        if isinstance(c.law, MassContact):
            drawn = np.array(smoothed(jax.device_put(speeds), c.law.slope))
            table["smoothed"] = table["coefficient"] * drawn
        self.tables["friction"] = table

    def _lubricated(self, given: OfLubricated) -> None:
        """Dry and fluid part over the speed at four approaches (Fig. 3.6-5)."""
        c, heat = self.contact, self.contact.settings.temperature
        (heights, R), area = c.surface, c.area
        assert heat is not None and area is not None
        # v* per m/s (3.6-22)
        star = given.mu_0 * heat.resistance * R * c.normal_0 / (heat.limit * area)
        eta = area**2 * heat.limit / (heat.resistance * given.mu_0**2 * c.normal_0**2 * R**3)
        v, approaches = np.linspace(0, min(10, FASTEST * star), 201), np.array([0.4, 0.6, 0.8, 1.0])
        dry, fluid = lubricated(heights, approaches, v, eta * given.viscosity, given.film)
        self.tables["friction"] = {
            "approach_m": np.repeat(approaches * R, len(v)),
            "speed_m/s": np.tile(v / star, len(approaches)),
            "coefficient": given.mu_0 * (dry + fluid).ravel(),
            "dry_part": given.mu_0 * dry.ravel(),
        }
        self.told.append(("smallest film over R_Z, where the fluid part is cut off", f"{given.film:g}"))

    # motion ----------------------------------------------------------------------------------------------------------

    def motion(self, motion: S.Motion, working: tuple[float, float]) -> None:
        """The motion of the file, hysteresis loops about the working point, and what a cycle does."""
        c = self.contact
        time = np.arange(motion.cycles * motion.samples + 1) / (motion.samples * motion.frequency)
        path = _path(motion, working[0])
        amplitudes = self._amplitudes(motion, working)
        u = np.asarray(_displacements(*path.args, time))
        loops = np.zeros((len(time), len(amplitudes), 3))  # along t1, from the middle on
        loops[..., 0] = working[0]
        loops[..., 1] = np.outer(np.sin(2 * np.pi * motion.frequency * time), amplitudes)
        if isinstance(c.law, MassContact):
            told = integrate(c.law, path, time)
            force, slip, speed = told.force, told.point, told.velocity
            friction = {f"friction_{name}_N": told.friction[:, i] for i, name in enumerate(AXES[1:])}
            slips = np.linalg.norm(speed, axis=1) * float(c.law.slope) > CREEP
            loop_force = np.asarray(history(c.law, loops, time[1]).force) if amplitudes else loops
        else:
            assert c.law is not None
            friction = {}
            done = history(c.law, np.concatenate([u[:, None], loops], axis=1), time[1])
            force, slip = np.asarray(done.force[:, 0]), np.array(done.slip[:, 0])
            loop_force = np.asarray(done.force[:, 1:])
            slips, speed = self._slips(force, slip), np.gradient(slip, time, axis=0)
        apart = (force[:, 0] <= 0) & c.settings.what.opens
        state = np.where(apart, OPEN, np.where(slips, SLIP, STICK))
        table = {"time_s": time}
        table |= {f"u_{name}_m": u[:, i] for i, name in enumerate(AXES)}
        table |= {f"F_{name}_N": force[:, i] for i, name in enumerate(AXES)}
        point = self._point(u, force, slip, float(time[1]))
        for i, name in enumerate(AXES[1:]):
            table |= {f"P_{name}_m": point[:, i], f"v_P_{name}_m/s": speed[:, i]}
        self.tables["motion"] = table | friction | {"state": state.astype(float)}
        if amplitudes:
            self.tables["loops"] = _loop_table(amplitudes, loops, loop_force, motion)
        self._of_a_cycle(u, force, state, motion, max(working[1], 0.0))

    def _point(self, u: np.ndarray, force: np.ndarray, slip: np.ndarray, dt: float) -> np.ndarray:
        """(s, 2) place of P, m: M less the stretch e of the springs (the mean over the area in contact), which follows
        from force = share k (e + beta e'); where the contact is open the springs are released and P stands at M.

        In the book's form the stretch stays when the contact opens: P slides in contact, and moves with M in the open.
        """
        c = self.contact
        share = values(c.normal, "share", u[:, 0])
        place = np.array(u[:, 1:])
        if isinstance(c.law, MassContact) and c.law.printed:
            for k in range(1, len(u)):
                moved = u[k, 1:] - u[k - 1, 1:] if share[k] <= 0 else slip[k] - slip[k - 1]
                place[k] = place[k - 1] + moved
            return place
        pull = force[:, 1:] / (np.maximum(share, 1e-300)[:, None] * np.array(c.tangential))
        lag = float(getattr(c.law, "damping", None) or 0.0) / dt
        stretch = np.zeros(2)
        for k in range(len(u)):
            stretch = (pull[k] + lag * stretch) / (1 + lag) if share[k] > 1e-9 else np.zeros(2)
            place[k] -= stretch
        return place

    def _amplitudes(self, motion: S.Motion, working: tuple[float, float]) -> tuple[float, ...]:
        """Of the hysteresis loops: those of the file, or about the displacement at which a stuck contact slides."""
        c, (approach, pressed) = self.contact, working
        if motion.amplitudes or motion.drift:
            return motion.amplitudes
        share = float(values(c.normal, "share", approach))
        mu = float(coefficients(c.sliding, 0.0, pressed)[0])
        if pressed <= 0 or share <= 0 or mu <= 0:
            return ()
        slides = mu * pressed / (c.tangential[0] * share)
        return tuple(slides * factor for factor in (0.5, 1.5, 3.0, 5.0))

    def _slips(self, force: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """(s,) whether P slides: of sliders in parallel, whether all of them do."""
        if isinstance(self.contact.law, PointContact | Jenkins):
            moved = np.linalg.norm(np.diff(slip, axis=0, prepend=slip[:1]), axis=1)
            return moved > 1e-9 * max(float(np.ptp(slip, axis=0).max()), 1e-300)
        held = coefficients(self.contact.sliding, 0.0, force[:, 0]) * force[:, 0]
        return np.hypot(force[:, 1], force[:, 2]) > (1 - 1e-6) * held

    def _of_a_cycle(
        self, u: np.ndarray, force: np.ndarray, state: np.ndarray, motion: S.Motion, pressed: float
    ) -> None:
        c, last = self.contact, _last_cycle(motion, u)
        mu = float(coefficients(c.sliding, 0.0, pressed)[0])
        self.told.append(("slip limit at the working point", self._sized(mu * pressed, "N")))
        what = "work of friction in the last period" if motion.drift else "energy dissipated in the last cycle"
        self.told.append((what, self._sized(_work(u[last], force[last]), "J")))
        shares = [100 * float(np.mean(state[last][1:] == s)) for s in (STICK, SLIP, OPEN)]
        words = "stick or partly slip / slip / open" if c.settings.what.partly else "stick / slip / open"
        self.told.append((f"{words}, of the last cycle", " / ".join(f"{s:.3g} %" for s in shares)))
        if shares[2] == 100:
            self.sentences.append("The contact never closes in the last cycle: raise the mean of motion.normal.")

    # microslip -------------------------------------------------------------------------------------------------------

    def first_loading(self, given: S.Microslip) -> None:
        """Tangential force over displacement (3.8), one curve an approach or a normal force."""
        c, heat = self.contact, self.contact.settings.temperature
        heights, R = c.surface
        assert c.area is not None
        mu = given.mu if given.mu is not None else getattr(c.settings.friction, "mu", 0.0)
        strength = given.yield_shear if given.yield_shear is not None else np.inf
        warmed = (heat.limit, heat.resistance) if heat is not None else (np.inf, 0.0)
        curve = microslip.of(
            heights, c.normal_0, c.tangential[0], c.area, R, mu, given.speed, strength, *warmed, R
        )
        if given.normal_forces:
            u = np.asarray(curve.approach(np.array(given.normal_forces) / (c.normal_0 * R)))
        else:
            u = np.array(given.approaches or tuple(R * x for x in (0.25, 0.5, 0.75, 1.0, 1.25))) / R
        slides = mu * c.normal_0 / c.tangential[0]  # displacement over approach at which all of it slides, cold
        top = given.displacement / R if given.displacement is not None else 1.25 * slides * float(u.max())
        w = np.linspace(0.0, top, 401)
        force, warm = (np.array([f(w, x) for x in u]) for f in (curve.force, curve.temperature))
        loads = c.normal_0 * R * np.asarray(curve.normal_force(u))
        table = {
            "approach_m": np.repeat(R * u, len(w)),
            "normal_force_N": np.repeat(loads, len(w)),
            "displacement_m": np.tile(R * w, len(u)),
            "F_t_N": mu * c.normal_0 * R * force.ravel(),
        }
        table["coefficient"] = table["F_t_N"] / table["normal_force_N"]
        if heat is not None:
            table["temperature_rise_K"] = heat.limit * warm.ravel()
        self.tables["microslip"] = table
        ratio = table["coefficient"].reshape(len(u), -1)
        ends = f"{ratio[:, -1].min():.4g} to {ratio[:, -1].max():.4g}, at most {ratio.max():.4g}"
        self.told.append(("equivalent friction coefficient at the end of loading", ends))

    # wear ------------------------------------------------------------------------------------------------------------

    def wear(self, given: S.Wear) -> None:
        """The course of wear at a constant normal force (3.9)."""
        c = self.contact
        (heights, R), area = c.surface, c.area
        assert area is not None
        if given.mu is not None:
            mu = given.mu
        else:
            mean = c.sliding.without_scatter()
            mu = float(coefficients(mean, given.speed, given.normal_force)[0])
        law = Rough(c.normal_0, R, heights)  # type: ignore[arg-type]
        time = given.time * np.linspace(0, 1, 201) ** 2  # the beginning is the fastest
        energy = mu * given.normal_force * given.speed * time
        coefficient = given.coefficient  # I_W, m3/J
        if given.archard is not None and given.hardness is not None:
            coefficient = from_archard(given.archard, given.hardness, mu)
        if coefficient is None:
            coefficient = from_energy_density(given.energy_density or 0.0)
        stars = dimensionless_time(energy, coefficient, law, area, np.asarray(given.normal_force))
        worn = course(heights, given.normal_force / (c.normal_0 * R), stars)
        scale, share = c.normal_0 * R / area, worn.area
        self.tables["wear"] = {
            "time_s": time,
            "dimensionless_time": stars,
            "approach_m": R * worn.approach,
            "area_share": share,
            "largest_pressure_Pa": scale * worn.pressure.max(axis=1),
            "peak_to_valley_m": R * worn.roughness,
            "normal_stiffness_N/m": c.normal_0 * share,
            "worn_volume_m3": coefficient * energy,
        }
        rows = [int(np.argmin(np.abs(time - t))) for t in np.linspace(0, 1, SHOWN) ** 2 * given.time]
        self.tables["wear_heights"] = {
            "time_s": np.repeat(time[rows], len(worn.share)),
            "area_share": np.tile(worn.share, SHOWN),
            "depth_m": R * worn.depth[rows].ravel(),
            "pressure_Pa": scale * worn.pressure[rows].ravel(),
        }
        cubes = 1.0 if self.contact.file.dimensionless else 1e9
        self.told.append(("worn volume", self._sized(cubes * coefficient * energy[-1], "mm³")))
        new, old = (f"{100 * share[i]:.4g} %" for i in (0, -1))
        self.told.append(("area in contact, new and worn", f"{new} and {old}"))

    # limits ----------------------------------------------------------------------------------------------------------

    def limits(self) -> None:
        """Up to which frequency the law holds, and whether the contact yields."""
        c, motion, limits = self.contact, self.contact.file.motion, self.contact.file.limits
        if motion is None:
            return
        if c.layer is not None and c.layer.density is not None:
            self.sentences.append(c.layer.quasi_static(motion.frequency, limits.tolerance).sentence())
        elif isinstance(c.law, MassContact):
            self.sentences.append(_element_margin(c.law, motion.frequency, limits.tolerance))
        if limits.yield_shear is not None and c.area is not None and "motion" in self.tables:
            self._yields(limits.yield_shear, motion, c.area)

    def _yields(self, yield_shear: float, motion: S.Motion, area: float) -> None:
        """Tresca at the mean pressure and shear of the area in contact, at every sample of the last cycle."""
        last = _last_cycle(motion, self.tables["motion"]["time_s"])
        table = {name: column[last] for name, column in self.tables["motion"].items()}
        share, time = self._area(table["u_n_m"]), table["time_s"]
        touching = area * np.maximum(share, 1e-12)
        force = [np.where(share > 0, table[f"F_{name}_N"], 0.0) / touching for name in AXES]
        pressure, shear = np.maximum(force[0], 0.0), np.stack(force[1:], axis=1)
        layer = self.contact.layer or Layer(Solid(2.1e11, 0.3), 1.0, self.contact.file.limits.boundary)
        names = [f"t = {t:.4g} s of the cycle" for t in time - time[0]]
        check = layer.check_yield(pressure, shear, yield_shear, names=names)
        self.tables["yield"] = {
            "time_s": time,
            "pressure_Pa": pressure,
            "shear_t1_Pa": shear[:, 0],
            "shear_t2_Pa": shear[:, 1],
            "share_of_yield": check.utilisation,
        }
        self.sentences.append(check.sentence(1))


SHOWN = 6
"""Height distributions drawn over the course of wear."""


@in_its_file
def study(path: Path | str, assignments: list[str] | None = None) -> Study:
    """Read a contact file and compute all that it gives what is needed for.

    Raises:
        UserError: every mistake, with file and key. NotConverged: an element that could not be integrated.
    """
    file = S.load_contact(path, assignments)
    if file.what.rigid:
        raise UserError(REFUSED)
    pressed = file.motion.normal_force if file.motion else None
    contact = compose(file, Path(path), pressed or 0.0)
    found = Study(contact, working=_working(contact))
    found.normal()
    if contact.friction is not None:
        found.characteristic()
    if file.motion is not None and found.working is not None and contact.law is not None:
        found.motion(file.motion, found.working)
    if file.microslip is not None:
        found.first_loading(file.microslip)
    if file.wear is not None:
        found.wear(file.wear)
    found.limits()
    found.sentences += moduli_doubted("", file)
    return found


def moduli_doubted(where: str, law: S.ContactLaw) -> list[str]:
    """What is said of moduli that no solid has. where: that they stand in, with a dot."""
    given = [(key, getattr(law.stiffness, key, None)) for key in ("young", "young_2")]
    told = [plausible.modulus(f"{where}stiffness.{key}", E) for key, E in given if E is not None]
    return [text for text in told if text]


def _working(c: ContactModel) -> tuple[float, float] | None:
    """Approach and force of the static state."""
    motion = c.file.motion
    if motion is None:
        return None
    force = motion.normal_force
    if force is None:
        return motion.normal[0], float(values(c.normal, "force", motion.normal[0]))
    if isinstance(c.law, Strips):  # a little away from the smooth law
        return float(c.law.approach(force)), force
    return approach_under(c, force), force


def approach_under(c: ContactModel, force: float) -> float:
    """Approach (m) at a normal force (N), by bisection down to rounding."""
    high = force / c.normal_0 + (c.roughness or 1e-6)
    for _ in range(200):
        if values(c.normal, "force", high) >= force:
            break
        high *= 2
    else:
        raise UserError(f"{force:g} N is more than the normal law reaches; lower it", "motion.normal_force")
    return float(bisected(lambda u: values(c.normal, "force", u) < force, -1e-9, high, 80)[1])


def _last_cycle(motion: S.Motion, samples: np.ndarray) -> slice:
    return slice(len(samples) - motion.samples - 1, None)


def _path(motion: S.Motion, mean: float) -> partial[jax.Array]:
    """Displacement (3,) in m over the time in s."""
    rows = [(mean, *motion.normal[1:]), motion.t1, motion.t2]
    table = np.zeros((3, max(map(len, rows)) | 1))  # a missing last sine is zero
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    drift = np.array([0.0, motion.drift, 0.0])
    return partial(_displacement, table, drift, 2 * np.pi * motion.frequency)


def _displacement(table: np.ndarray, drift: np.ndarray, omega: float, t: jax.Array) -> jax.Array:
    orders = range(1, table.shape[1] // 2 + 1)
    waves = [jnp.ones(())] + [f(h * omega * t) for h in orders for f in (jnp.cos, jnp.sin)]
    return table @ jnp.stack(waves) + drift * t


_displacements = program(jax.vmap(_displacement, (None, None, None, 0)))


def _loop_table(amplitudes: tuple[float, ...], u: np.ndarray, force: np.ndarray, motion: S.Motion) -> Columns:
    """First loading and the last cycle, one amplitude after the other."""
    first, last = np.arange(len(u))[: motion.samples // 4 + 1], np.arange(len(u))[_last_cycle(motion, u)]
    rows, a = np.concatenate([first, last]), len(amplitudes)
    return {
        "amplitude_m": np.repeat(amplitudes, len(rows)),
        "cycle": np.tile(np.repeat([0.0, 1.0], [len(first), len(last)]), a),
        "u_t1_m": u[rows, :, 1].T.ravel(),
        "F_t1_N": force[rows, :, 1].T.ravel(),
        "dissipated_J": np.repeat([_work(u[last, i], force[last, i]) for i in range(a)], len(rows)),
    }


def _work(u: np.ndarray, force: np.ndarray) -> float:
    """Integral of force . du over a path (s, 3), J."""
    return float(0.5 * np.sum((force[1:] + force[:-1]) * np.diff(u, axis=0)))


def _element_margin(law: MassContact, frequency: float, tolerance: float) -> str:
    """(3.7-45): the mass element's own frequency sqrt(c_R0/m) far above that of the motion."""
    own = float(np.sqrt(np.asarray(law.stiffness_1) / np.asarray(law.mass))) / (2 * np.pi)
    error = quasi_static_error(frequency / own)
    verdict = "may" if error <= tolerance else "must not"
    return (
        f"At {frequency:.4g} Hz the contact element {verdict} be used: its own frequency is {own:.4g} Hz, so the layer "
        f"it stands for is {100 * error:.2g} % too stiff there; {100 * tolerance:.2g} % are allowed."
    )


# numbers -----------------------------------------------------------------------------------------------------------

_PREFIX = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def _engineering(value: float, unit: str) -> str:
    """A number with a prefix that leaves one to three digits before the point; stiffnesses as the file has them."""
    if unit in ("N/m", "mm³") or value == 0 or not np.isfinite(value):
        return f"{value:.4g} {unit}"
    factor, prefix = next((p for p in _PREFIX if abs(value) >= 0.99995 * p[0]), _PREFIX[-1])
    return f"{value / factor:.4g} {prefix}{unit}"
