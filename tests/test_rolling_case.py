"""Friction characteristics, temperature and wear of a rolling case (Sextro 6.5, 6.7, 6.8)."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused_command
from scipy.integrate import quad
from scipy.optimize import brentq

import microslip as ms
from microslip.cli import main
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import value
from microslip.contact.solids import Solid
from microslip.errors import UserError
from microslip.pictures.rolling import stretched
from microslip.rolling.behind import even
from microslip.rolling.laws import COLD, RoughSurface
from microslip.rolling.settings import load_rolling
from microslip.rolling.study import RollingAnswer, rows_of_patches, study
from microslip.rolling.temperature import falling
from microslip.rolling.wearing import wearing

CASE = Path(__file__).parents[1] / "pipeline" / "cases" / "wheel-rail.toml"
FEW = ("creep.points=3", "creep.stop=0.02", "model.exact=0")


@pytest.fixture(autouse=True)
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def studied(*changes: str) -> RollingAnswer:
    return study(load_rolling(CASE, [*FEW, "creep.spin=0.0", *changes])[0], CASE)


def test_friction_that_falls_with_the_speed_of_sliding() -> None:
    """Where all slides F = mu(V xi) F_N (3.6-15); constant models stand beside it no more, and the reader is told."""
    found = studied('friction={kind = "falling", mu_0 = 0.4, p_v = 0.5}')
    assert found.forces is not None
    mu = 0.4 / (1 + 0.5 * found.patches[0].speed * found.over[1:])
    np.testing.assert_allclose(-found.forces.x[1:], mu * found.patches[0].normal_force, rtol=5e-3)
    assert found.reference is None and found.exact is None
    assert any("highest coefficient, 0.4;" in s for s in found.sentences())


def test_what_is_rounding_is_no_force() -> None:
    """A wheel in the middle that rolls freely without spin, and creepage along rolling alone."""
    found = studied("pose.lateral=0.0", "creep.lateral=0.0")
    felt = np.array([row[2:] for row in found.generalised()[1]], float)
    assert (felt[:, [0, 1, 4, 5]] == 0).all() and felt[0, 2] == pytest.approx(1e5)
    assert (found.columns()["F_y_left_N"] == 0).all() and (found.columns()["M_z_up_Nm"] == 0).all()
    assert "feels 0 N forward, 0 N to the right" in found.sentences()[0]


def test_tables_have_one_frame() -> None:
    """x forward, y to the left, z up in all: where the surface is nearly level the forces of the curve are those of the
    pose on the wheel, and its patch lies right of the middle and near the tops of the rails."""
    found = studied("pose.yaw=0.002")
    head, rows = found.generalised()
    felt, (p,), forces = dict(zip(head, rows[0], strict=True)), found.patches, found.of_pose
    assert forces is not None and set(head[2:]) > {k for k in found.columns() if k in head}
    across = forces.y[0] * np.cos(p.angle) - p.normal_force * np.sin(p.angle)
    assert (felt["F_x_forward_N"], felt["F_y_left_N"]) == pytest.approx((forces.x[0], across), rel=1e-9)
    assert float(felt["F_z_up_N"]) == pytest.approx(1e5, rel=1e-6)
    names, places = rows_of_patches(found.patches)
    place = dict(zip(names, places[0], strict=True))
    assert place["y_left_m"] == -p.place[1] < 0 and place["z_up_m"] == -p.place[2]


def test_a_patch_that_reaches_beyond_a_profile_is_doubted() -> None:
    """17 mm wide, its middle 10 mm off that of the wheel's profile."""
    wide, narrow = (" ".join(studied(f"wheel.width={w}").sentences()) for w in (0.04, 0.03))
    assert "beyond the end of a profile" in narrow and "beyond the end" not in wide


def test_temperature_where_all_slides_is_the_integral_of_the_book() -> None:
    """(6.7-11) by quadrature under q = mu p V xi, hottest on the middle strip; unlike bodies, that meet unlike warm."""
    found = studied("heat.conductivity=[50, 20]", "heat.start=[40, 10]")
    p, xi = found.patches[0], found.over[-1]
    root = np.sqrt(np.array([50.0, 20.0]) * 7850 * 450)
    start = root @ [40, 10] / root.sum()
    q = 0.3 * 2 * p.normal_force / (np.pi * p.a * p.b) * p.speed * xi  # parabolic pressure of the strips

    def rise(way: float) -> float:  # from the leading edge; w^2 is the way to the source
        inside = lambda w: 2 * (1 - ((way - w * w) / p.a - 1) ** 2)  # noqa: E731
        return q / root.sum() / np.sqrt(np.pi * p.speed) * quad(inside, 0, np.sqrt(way))[0]

    exact = start + max(rise(w) for w in np.linspace(0.5, 2, 151) * p.a)
    assert found.hottest is not None
    assert found.hottest[2] - start == pytest.approx(exact - start, rel=1e-2)
    assert found.hottest[0] < start + 0.02 * (exact - start)


def test_friction_that_falls_with_the_temperature_it_makes() -> None:
    """Both belong together: less force than cold, less heat, and at the hottest place no less than mu(T) holds."""
    cold, warm = studied("heat.limit=1e9"), studied("heat.limit=300")
    assert cold.forces is not None and warm.forces is not None
    assert cold.hottest is not None and warm.hottest is not None
    assert cold.forces.x[2] == pytest.approx(-cold.held, rel=1e-3)
    least = float(falling(warm.hottest[2] - COLD, 1.0, 300))
    assert least < -warm.forces.x[2] / warm.held < 0.97 and warm.hottest[2] < 0.95 * cold.hottest[2]
    power = warm.forces.power[2] / cold.forces.power[2]
    assert power == pytest.approx(warm.forces.x[2] / cold.forces.x[2], rel=2e-3)


def test_worn_volume_is_the_coefficient_times_the_work_of_friction() -> None:
    """Of all patches of the pose, with spin, whatever the friction; what spin adds to that of the creepages is told."""
    for friction in ("0.3", '{kind = "falling", mu_0 = 0.4, p_v = 0.5}'):
        found = studied("wear.coefficient=2e-14", f"friction={friction}")
        worn = found.worn()
        assert found.of_pose is not None and (worn["depth_m"] >= 0).all()
        assert worn["depth_m"] @ worn["width_m"] == pytest.approx(2e-14 * found.of_pose.power.sum(), rel=1e-10)
        assert any("times the power of the creepages" in s for s in found.warnings())


def test_a_rough_case_has_its_own_curve() -> None:
    """A number is R_Z in m of the polynomial; models without roughness do not stand beside it."""
    smooth, rough = studied("creep.stop=0.002"), studied("creep.stop=0.002", "roughness=2e-5")
    assert smooth.forces is not None and rough.forces is not None
    assert (np.abs(rough.forces.x[1]) < 0.99 * np.abs(smooth.forces.x[1])) and rough.reference is None
    assert any("know no roughness" in s for s in rough.sentences())


def test_tables_and_page_hold_temperature_and_wear(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A measured characteristic beside the case; the largest temperature of the page is that of the table."""
    shutil.copy(CASE, tmp_path / "case.toml")
    (tmp_path / "mu.csv").write_text("speed,mu\n0.01,0.4\n0.1,0.3\n1,0.2\n")
    given = ('friction={kind="table", file="mu.csv"}', "heat={}", "wear.coefficient=1e-14", *FEW)
    sets = [word for setting in given for word in ("--set", setting)]
    assert main(["roll", "case.toml", *sets, "--no-pictures"]) == 0
    folder, said = tmp_path / "build" / "wheel-rail", capsys.readouterr().out
    hot = max(float(row["largest_temperature_C"]) for row in csv.DictReader((folder / "creep.csv").open()))
    deepest = max(float(row["depth_m"]) for row in csv.DictReader((folder / "wear.csv").open()))
    assert f"at most {hot:.4g} degrees C hot" in said and f"at most {1e9 * deepest:.4g} nm off" in said
    assert not (folder / "exact.csv").exists()
    (tmp_path / "mu.csv").write_text("speed,mu\n0.01,0.2\n0.1,0.15\n1,0.1\n")
    assert main(["roll", "case.toml", *sets, "--no-pictures"]) == 0
    assert f"{hot:.4g} degrees C hot" not in capsys.readouterr().out


def test_what_is_wrong_with_a_file_beside_the_case_names_the_case_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = shutil.copy(CASE, tmp_path / "a.toml")
    for key in ("friction", "roughness"):
        assert main(["roll", "a.toml", "-q", "--set", f'{key}={{kind="table", file="x.csv"}}']) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"error: a.toml: {key}.file: there is no file") and "case.toml" not in said
    assert case.is_file() and not list((tmp_path / "build").rglob("*.csv"))


def test_both_wheels_of_an_axle() -> None:
    """Each carries the vertical force; forces about the axle are those of its wheels, and mirror with the pose."""
    one, other = (
        studied("pose.side='both'", f"pose.lateral={0.003 * s}", f"pose.yaw={0.001 * s}", "wear.coefficient=1e-14")
        for s in (1, -1)
    )
    assert [p.side for p in one.patches] != [p.side for p in other.patches] and len(one.patches) == 2
    felt = [{p.side: np.array(row[2:], float) for row, p in zip(f.generalised()[1][::2], f.patches, strict=True)}
            for f in (one, other)]  # fmt: skip
    np.testing.assert_allclose([felt[0][side][2] for side in felt[0]], 1e5, rtol=1e-6)
    np.testing.assert_allclose(felt[0]["left"], felt[1]["right"] * [1, -1, 1, -1, 1, -1], rtol=1e-6, atol=1e-2)
    assert sum("wheel feels" in s for s in one.sentences()) == 2 and len(set(one.worn()["patch"])) == 2


def test_profiles_that_wear_are_run_on_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first update is the wear of a passage times their number; a case that takes the worn profiles has the
    pressure of the last row."""
    shutil.copy(CASE, tmp_path / "case.toml")
    wear = "wear={coefficient=2e-13, updates=4, passages=4e5}"
    sets = [w for s in ("creep.points=3", "model.exact=0") for w in ("--set", s)]
    assert main(["roll", "case.toml", *sets, "--set", wear, "--no-pictures"]) == 0
    assert "After 4e+05 passages" in capsys.readouterr().out
    folder = tmp_path / "build" / "wheel-rail"
    for name in ("wheel_worn", "rail_worn"):
        shutil.copy(folder / f"{name}.csv", tmp_path)
    rows, once = (list(csv.DictReader((folder / f"{name}.csv").open())) for name in ("wearing", "wear"))
    assert float(rows[1]["deepest_wheel_m"]) == pytest.approx(1e5 * max(float(r["depth_m"]) for r in once), rel=0.02)
    again = ["wheel.profile='wheel_worn.csv'", "rail.profile='rail_worn.csv'", "wheel.at=0.75", "rail.at=0.75"]
    assert main(["roll", "case.toml", *sets, *(w for s in again for w in ("--set", s)), "--no-pictures", "-q"]) == 0
    patch = next(csv.DictReader((folder / "patches.csv").open()))
    assert float(patch["largest_pressure_Pa"]) == pytest.approx(float(rows[-1]["largest_pressure_Pa"]), rel=1e-3)
    assert float(rows[-1]["largest_pressure_Pa"]) < 0.97 * float(rows[0]["largest_pressure_Pa"])


def test_worn_volume_and_mirror() -> None:
    """Off both bodies, the coefficient times the work of friction; the left wheel of the mirrored pose wears alike."""
    wear = "wear={coefficient=2e-13, updates=3, passages=3e5, lateral=[%g, %g]}"
    case, mirror = (
        load_rolling(CASE, [*FEW, wear % (0.002 * s, 0.004 * s), f"pose.yaw={0.001 * s}", f"pose.side='{side}'"])[0]
        for s, side in ((1, "right"), (-1, "left"))
    )
    one, other = (wearing(c, c.track(CASE.parent), c.characteristic(CASE)) for c in (case, mirror))
    assert one.moments[-1].volume == pytest.approx(2 * 2e-13 * one.work, rel=1e-9)
    np.testing.assert_allclose(other.wheel.depth, one.wheel.depth, atol=1e-9 * one.wheel.depth.max())
    few = load_rolling(CASE, [*FEW, "wear={coefficient=2e-13, updates=1, passages=3e5, smoothing=0}"])[0]
    told = wearing(few, case.track(CASE.parent), case.characteristic(CASE)).warnings()
    assert len(told) == 1 and "warning: an update takes so much" in told[0]
    deep = load_rolling(CASE, [*FEW, "wear={coefficient=2e-13, updates=2, passages=2.5e6}"])[0]
    assert any("the grooves" in s for s in wearing(deep, case.track(CASE.parent), Coulomb(value(0.3))).warnings())


def test_profiles_of_rough_bodies_wear_as_a_rough_passage() -> None:
    """Two ways to a passage in the pose: that of `wear.csv` and that of the first update."""
    given = (*FEW, "roughness=5e-5", "pose.yaw=0.003", "wear={coefficient=1e-13, updates=1, passages=1.0}")
    case = load_rolling(CASE, given)[0]
    worn = study(case, CASE).worn()
    found = wearing(case, case.track(CASE.parent), case.characteristic(CASE), case.surface(CASE))
    assert found.moments[-1].volume == pytest.approx(2 * worn["depth_m"] @ worn["width_m"], rel=1e-3)


def test_another_table_of_heights_is_another_curve(tmp_path: Path) -> None:
    """A file of roughness is an input like a profile."""
    shutil.copy(CASE, tmp_path / "case.toml")
    found = []
    for middle in (0.2, 0.8):
        (tmp_path / "heights.csv").write_text(f"0,0\n2e-5,{middle}\n4e-5,1\n")
        sets = [w for s in ('roughness={kind="table", file="heights.csv"}', *FEW) for w in ("--set", s)]
        assert main(["roll", "case.toml", *sets, "--no-pictures", "-q"]) == 0
        found.append((tmp_path / "build" / "wheel-rail" / "creep.csv").read_text())
    assert found[0] != found[1]


# --- roughness -------------------------------------------------------------------------------------------------------

PATCH = {"a": 8e-3, "b": 4e-3, "normal_force": 82e3, "friction": Coulomb(value(0.3)), "speed": 20.0, "shear": 82e9,
         "poisson": 0.28}  # fmt: skip


def test_rough_bodies_carry_the_same_force_and_are_softer() -> None:
    """Without slip, by quadrature: area that comes into contact carries nothing yet, t' = -k h s, and what is lost
    takes its part along, (t/h)' = -k s, with (3.3-4) for h and the depth that makes the force F_N. Smooth bodies are
    the limit; all that slides carries mu F_N."""
    smooth = ms.creep_forces([1e-9, 2e-3, 5e-2], 0, 0, 8e-3, 4e-3, 82e3, 0.3, 82e9, 0.28)
    rough = [ms.forces_by_characteristic([1e-9, 2e-3, 5e-2], 0, 0, **PATCH,
                                         surface=RoughSurface(Polynomial(), value(R)))
             for R in (1e-13, 9.267e-5 / 2)]  # fmt: skip
    np.testing.assert_allclose(rough[0].x, smooth.x, rtol=1e-6)
    np.testing.assert_allclose(rough[1].x[2], -0.3 * 82e3, rtol=1e-6)
    reach = np.cos(np.pi * (np.arange(100) + 0.5) / 200)[:, None]  # of strips, over a; their width goes with it too
    x = reach * (1 - (np.arange(400) + 0.5) / 200)  # from the leading edge on
    u, dx, area = 2 * (reach**2 - x**2), reach / 200, reach**2 * np.ones_like(x)  # u: of smooth bodies, over R_Z

    def missing(more: float) -> float:
        return float(np.sum((np.asarray(Polynomial().volume(jnp.asarray(more * u))) - u) * area))

    h = np.asarray(Polynomial().area(jnp.asarray(brentq(missing, 1, 3) * u)))
    front = np.cumsum(h * dx, axis=1)[:, :200]
    rear = h[:, 200:] * (front[:, -1:] / h[:, 199:200] + np.arange(1, 201) * dx)
    slope = np.sum(np.hstack([front, rear]) * area) / np.sum((reach - x) * area)
    assert rough[1].x[0] / smooth.x[0] == pytest.approx(slope, rel=0.01)


# --- bodies behind the patch -----------------------------------------------------------------------------------------


def test_an_even_traction_on_a_square() -> None:
    """Mean of 1/r over a square of side 1: 4 ln(1 + sqrt 2) - 4 (sqrt 2 - 1)/3; normal (1 - nu)/(2 pi G) of it, along a
    side the mean of both Cerruti terms, (1 - nu/2)/(2 pi G)."""
    mean = 4 * np.log(1 + np.sqrt(2)) - 4 * (np.sqrt(2) - 1) / 3
    normal, along, across = even(Solid(2.1e11, 0.28), 0.02, 0.02) * 2 * np.pi * Solid(2.1e11, 0.28).shear * 0.02
    assert normal == pytest.approx(0.72 * mean, rel=5e-4)
    np.testing.assert_allclose([along, across], 0.86 * mean, rtol=5e-4)


@pytest.mark.slow
def test_what_yields_behind_a_patch_is_counted_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A rail whose modes hold little and one whose basis holds all, with patches of unlike size: the same stiffness, to
    1 %; only the spring that belongs beside the modes differs. A patch that is too small is refused."""
    shutil.copytree(CASE.parents[2] / "geometry" / "rail", tmp_path / "geometry" / "rail")
    shutil.copy(CASE, tmp_path / "case.toml")
    body = tmp_path / "geometry" / "rail" / "body.toml"
    one = body.read_text().replace("size = 30.0", "size = 40.0")
    wide = one.replace("patch_length = 30.0", "patch_length = 40.0").replace("patch_width = 26.0", "patch_width = 34.0")
    rows = []
    for text in (one, 'reduction = "rubin"\n' + wide):
        body.write_text(text)
        sets = ["--set", 'elastic={wheel="rail"}', "--set", "model.exact=0", "--set", "creep.points=3"]
        assert main(["roll", "case.toml", *sets, "--no-pictures"]) == 0
        assert "as elastic bodies the sticking patch" in capsys.readouterr().out
        with (tmp_path / "build" / "wheel-rail" / "stiffness.csv").open() as file:
            rows.append({r["direction"]: {k: float(v) for k, v in r.items() if k != "direction"}
                         for r in csv.DictReader(file)})  # fmt: skip
    for name in ("normal", "along", "across"):
        of = [r[name] for r in rows]
        assert of[1]["stiffness_N_per_m"] == pytest.approx(of[0]["stiffness_N_per_m"], rel=0.01)
        assert of[0]["stiffness_N_per_m"] < 0.9 * of[0]["stiffness_half_spaces_N_per_m"]
        assert of[1]["rail_beyond_modes_nm_per_kN"] < 0 < of[0]["rail_modes_nm_per_kN"]
    assert rows[1]["normal"]["spring_beside_modes_N_per_m"] > 1.2 * rows[0]["normal"]["spring_beside_modes_N_per_m"]
    for change, words in (("vertical_force=4e6", "larger than the face"), ("rail.young=1e11", "rail.young")):
        refused_command(["roll", "case.toml", *sets, "--set", change, "-q"], capsys, words)


def test_keys_of_the_other_kind_of_profile_are_refused() -> None:
    """A mirror, noise or a range of a formula, and a width of a file, would do nothing."""
    for change in ('wheel.mirror="y"', "rail.noise=1e-5", "wheel.between=[-0.01, 0.01]"):
        with pytest.raises(UserError, match=change.split("=")[0].replace(".", r"[.: ]+")):
            load_rolling(CASE, ["wheel.profile=-0.5", "rail.profile=0.3", change])
    with pytest.raises(UserError, match="width"):
        load_rolling(CASE, ['wheel.profile="S1002.prw"', "wheel.width=0.05"])


def test_narrow_patches_are_drawn_with_room_for_their_numbers() -> None:
    """A flange's patch, seventeen times as long as wide, is drawn three times as long; a usual one as it is."""
    for size, drawn in (((17.0, 1.0), 1 / 3), ((1.0, 17.0), 3.0), ((1.0, 2.0), 2.0), ((2.0, 1.0), 0.5)):
        assert stretched(np.array(size)) * size[1] / size[0] == pytest.approx(drawn)
