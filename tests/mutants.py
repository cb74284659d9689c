"""Do the quick tests see a mistake? Each of these is put into a copy of the package, one at a time.

    python tests/mutants.py         all of them
    python tests/mutants.py 3 17    these numbers

The tests that should see it are run on that copy; the first one that fails has caught it. At the
end those that caught a mistake must pass on the copy without any. Exit code 1: a mistake SURVIVED,
its old text does not stand in the file once, or a test fails without it as well.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]


class Mistake(NamedTuple):
    """Attributes: what: in words. file: of the package. old, new: text that stands there once, and
    what is put in its place. tests: file of quick ones that should see it. test: one of them."""

    what: str
    file: str
    old: str
    new: str
    tests: str
    test: str = ""

    @property
    def asked(self) -> str:
        """As pytest names it, in the folder of tests."""
        return f"{self.tests}::{self.test}" if self.test else self.tests


MISTAKES = (
    # contact laws
    Mistake(
        "Jenkins: sign of the path slid",
        "contact/jenkins.py",
        "slipped = state.slipped + ratio(trial - elastic,",
        "slipped = state.slipped + ratio(elastic - trial,",
        "test_jenkins.py",
        "test_the_slip_is_what_the_spring_with_the_slider_does_not_take",
    ),
    Mistake(
        "Iwan: a factor of Segalman's slip displacements",
        "contact/sliders.py",
        "/ shares * (exponent + 1) / (exponent + 2)",
        "/ shares / (exponent + 2)",
        "test_contact_microslip.py",
        "test_segalman_s_first_loading_and_power_law_of_dissipation",
    ),
    Mistake(
        "sliders: the energy of friction twice",
        "contact/sliders.py",
        "rubbed = 0.5 * (before.limits + after.limits)",
        "rubbed = (before.limits + after.limits)",
        "test_contact_laws.py",
        "test_a_law_counts_what_a_cycle_takes",
    ),
    Mistake(
        "wear: in full contact what is kept for what has grown",
        "contact/wear.py",
        "force * (1 - kept), grown)",
        "force * kept, grown)",
        "test_contact_wear.py",
        "test_in_full_contact_differences_decay_exponentially",
    ),
    Mistake(
        "Hertz: tangential stiffness of the two axes exchanged",
        "contact/hertz.py",
        "for J in (D, B))",
        "for J in (B, D))",
        "test_contact_stiffness.py",
        "test_sticking_traction_moves_the_ellipse_as_a_whole",
    ),
    Mistake(
        "normal law: exponent of the stored energy",
        "contact/normal.py",
        "self.depth / (self.exponent + 1) * self._power",
        "self.depth / self.exponent * self._power",
        "test_contact_rough.py",
        "test_the_energy_of_a_power_law_is_the_integral_of_its_force",
    ),
    Mistake(
        "rough layer: sign of what shortening adds to its stiffness",
        "contact/normal.py",
        "(area + self._force(u) / self.length)",
        "(area - self._force(u) / self.length)",
        "test_contact_rough.py",
        "test_stiffness_and_energy_belong_to_the_force",
    ),
    Mistake(
        "point contact: a term of the derivative over what friction holds",
        "contact/point.py",
        "by_held = at_first * s + at_last + by_excess",
        "by_held = at_first * s + by_excess",
        "test_contact_point.py",
        "test_derivatives_of_a_straight_way_are_those_of_differences",
    ),
    # harmonic balance
    Mistake(
        "alternating frequency/time: directions of the derivative transposed",
        "harmonic_balance/forces.py",
        '"nia,cnikjl->cnajkl", G, slope.reshape(c, n, 3, W, 3, W)',
        '"nia,cnjkil->cnajkl", G, slope.reshape(c, n, 3, W, 3, W)',
        "test_harmonic_balance_laws.py",
        "test_derivatives_against_differences",
    ),
    Mistake(
        "balance: sign of the force's change with the frequency",
        "harmonic_balance/problem.py",
        "slower = -self.period / self.Omega",
        "slower = self.period / self.Omega",
        "test_harmonic_balance_laws.py",
        "test_derivatives_against_differences",
    ),
    Mistake(
        "ring of blocks: an index of what is eliminated",
        "harmonic_balance/blocks.py",
        "D[down] -= before_it[..., 1 + s :]",
        "D[down] -= before_it[..., 1 : 1 + s]",
        "test_eliminated.py",
        "test_parts_in_a_row_are_solved_one_by_one_however_they_are_numbered",
    ),
    Mistake(
        "condensed: factor 2 of the inertia's change with the frequency",
        "harmonic_balance/reduced.py",
        "slope = -2 * harmonic * w * part.M",
        "slope = -harmonic * w * part.M",
        "test_eliminated.py",
        "test_sums_over_the_eigenvalues_are_the_solutions_of_the_equations",
    ),
    Mistake(
        "condensed: a conjugate of what loads do beside the modes",
        "harmonic_balance/reduced.py",
        "driven = part.load - T.conj().T @ (held @ part.given)",
        "driven = part.load - T.T @ (held @ part.given)",
        "test_eliminated.py",
        "test_sums_over_the_eigenvalues_are_the_solutions_of_the_equations",
    ),
    Mistake(
        "energy: circulatory work twice",
        "harmonic_balance/reduced.py",
        "lost += 0.5 * _squared(turning, q).imag",
        "lost += _squared(turning, q).imag",
        "test_roots.py",
        "test_the_harmonic_balance_takes_circulatory_forces_and_motions_in_time_refuse_them",
    ),
    Mistake(
        "series: sign of a derivative",
        "series.py",
        "= factors, -np.asarray(factors)",
        "= factors, np.asarray(factors)",
        "test_stability.py",
        "test_damping_that_follows_speed_and_place_leaves_the_product_of_the_multipliers",
    ),
    Mistake(
        "stability: a multiplier's error left out of the verdict",
        "harmonic_balance/stability.py",
        "outside = np.abs(values) > 1.0 + np.maximum(margin, error)",
        "outside = np.abs(values) > 1.0 + margin",
        "test_stability.py",
        "test_what_multipliers_say",
    ),
    # bifurcation
    Mistake(
        "Floquet: pieces of a period in the wrong order",
        "bifurcation/shooting.py",
        "product = piece @ product",
        "product = product @ piece",
        "test_bifurcation.py",
        "test_hopf_normal_form_is_found_with_its_circles",
    ),
    Mistake(
        "Hopf point: a factor in its criticality",
        "bifurcation/equilibria.py",
        "- 2 * form(q, mean)",
        "- form(q, mean)",
        "test_bifurcation.py",
        "test_criticality_counts_quadratic_terms",
    ),
    Mistake(
        "condensed orbits: sign of the sines",
        "bifurcation/balance.py",
        "D[2 * h - 1], D[2 * h] = part.real, -part.imag",
        "D[2 * h - 1], D[2 * h] = part.real, part.imag",
        "test_condensed.py",
        "test_derivatives_at_an_orbit_are_those_of_differences",
    ),
    # motions in time
    Mistake(
        "stepper: energy by the speed after a kick",
        "time_domain/kicks.py",
        "(touched, pushed, 0.5 * (now.y[:, p:] + v))",
        "(touched, pushed, v)",
        "test_time_domain.py",
        "test_energy_is_kept_to_rounding_and_what_contacts_do_with_it_to_second_order",
    ),
    Mistake(
        "impacts: sign of the restitution",
        "time_domain/contacts.py",
        "along = goes[:, 0] + law.restitution * come[:, 0]",
        "along = goes[:, 0] - law.restitution * come[:, 0]",
        "test_set_valued.py",
        "test_a_ball_comes_to_rest_after_infinitely_many_impacts",
    ),
    # continuation
    Mistake(
        "arclength: tolerance of a fold",
        "continuation/curve.py",
        "lambda y, t: float(t[-1]), 1e-8)",
        "lambda y, t: float(t[-1]), 1e-2)",
        "test_continuation.py",
        "test_folds_of_a_cubic_are_located_and_values_hit_exactly",
    ),
    Mistake(
        "optimum: < for <= at the first interval",
        "continuation/extremum.py",
        "if 0 <= at < len(known) - 1:",
        "if 0 < at < len(known) - 1:",
        "test_peaks.py",
        "test_a_valley_beside_an_end_is_found",
    ),
    Mistake(
        "peak: what moves with the parameter left out of its rate",
        "continuation/extremum.py",
        "rate=g_p + slope(y, moved)",
        "rate=g_p",
        "test_peaks.py",
        "test_rates_are_the_derivative_of_the_peaks_height",
    ),
    # bodies: prestress, sectors, reduction
    Mistake(
        "prestress: centrifugal force of the undeformed body",
        "modal/equilibrium.py",
        "position = model.d.mesh.points + u - model.point",
        "position = model.d.mesh.points - model.point",
        "test_rotation.py",
        "test_forces_balance_and_the_tangent_is_their_derivative",
    ),
    Mistake(
        "run-up: sign of the Euler force",
        "modal/invariants.py",
        'euler = -np.einsum("nia,ni->a"',
        'euler = np.einsum("nia,ni->a"',
        "test_gyroscopic.py",
        "test_run_up_terms_are_their_integrals",
    ),
    Mistake(
        "sector: the turn of the cut faces transposed",
        "fem/cyclic.py",
        "> 1e-14, cut.rotation, 0.0)",
        "> 1e-14, cut.rotation.T, 0.0)",
        "test_sector.py",
        "test_displacements_obey_the_phase_rule",
    ),
    Mistake(
        "sector: a conjugate of the neighbour on the other side",
        "modal/sector.py",
        "else np.conj(phase) for g in kept]",
        "else phase for g in kept]",
        "test_cyclic_ring.py",
        "test_either_side_may_press_on_the_other",
    ),
    Mistake(
        "Craig-Bampton: sign in the inertia-relief shapes",
        "reduction/craig_bampton.py",
        "R @ c - answers @ g",
        "R @ c + answers @ g",
        "test_reduction.py",
        "test_free_bodies_keep_rigid_motions_and_answer_with_inertia_relief",
    ),
    # finite elements
    Mistake(
        "strain: two shears exchanged",
        "fem/operators.py",
        "2 * E[..., 1, 2], 2 * E[..., 0, 2]]",
        "2 * E[..., 0, 2], 2 * E[..., 1, 2]]",
        "test_fem.py",
        "test_stiffness_gives_the_energy_of_a_uniform_strain",
    ),
    Mistake(
        "pyramids: weights of the quadrature",
        "elements.py",
        "roots_jacobi(n, 2, 0)",
        "roots_jacobi(n, 1, 0)",
        "test_wedges.py",
        "test_rule_integrates_what_it_should",
    ),
    Mistake(
        "pressure: sign",
        "fem/loads.py",
        "nodal = -value * np.einsum",
        "nodal = value * np.einsum",
        "test_fem.py",
        "test_loads_have_the_resultants_of_statics",
    ),
    # rolling, vehicle
    Mistake(
        "Kalker's coefficients: a factor between Poisson's ratios",
        "rolling/kalker.py",
        "middle * 8 * x * (1 - 2 * x)",
        "middle * 4 * x * (1 - 2 * x)",
        "test_rolling.py",
        "test_coefficients_at_the_rows_and_between_poissons_ratios",
    ),
    Mistake(
        "FASTSIM: where a step takes the spin",
        "rolling/fastsim.py",
        "phi * (x[i] + h / 6)",
        "phi * (x[i] - h / 2)",
        "validation/test_rolling_references.py",
        "test_fastsim_with_spin",
    ),
    Mistake(
        "strips: where a step takes the spin",
        "rolling/strips.py",
        "pose.phi_y * (x + 0.5 * h))",
        "pose.phi_y * (x - 0.5 * h))",
        "test_rolling.py",
        "test_strips_converge_with_their_order",
    ),
    Mistake(
        "wheelset: sign of what goes down ahead of the axle",
        "rolling/wheelset.py",
        "(c * left - s * fall) / V",
        "(c * left + s * fall) / V",
        "test_rolling.py",
        "test_creepages_are_those_of_the_wheels_rigid_motion",
    ),
    Mistake(
        "vehicle: sign of the gyroscopic moments",
        "vehicle/motion.py",
        "jnp.stack([0.0, 0.0, -u[3], u[2], 0.0, 0.0])",
        "jnp.stack([0.0, 0.0, u[3], -u[2], 0.0, 0.0])",
        "test_vehicle.py",
        "test_an_axle_off_its_rails_keeps_its_angular_momentum",
    ),
    Mistake(
        "vehicle: the moment of a wheel that is out of round",
        "vehicle/motion.py",
        "dragged[Q] - jnp.sum(on.vertical * rise))",
        "dragged[Q])",
        "test_vehicle.py",
        "test_pull_and_torque_bring_what_is_stored_rubbed_and_damped",
    ),
    # mistuning
    Mistake(
        "mistuning: workers in single precision",
        "contact/law.py",
        "    prepare()\n    made = object.__new__(cls)",
        "    made = object.__new__(cls)",
        "test_contact_laws.py",
        "test_laws_come_to_another_process_in_double_precision",
    ),
    Mistake(
        "Weibull: sign of the exponent of the median",
        "mistuning/weibull.py",
        "np.exp(x * np.log(np.log(2)) - gammaln(1 + x))",
        "np.exp(-x * np.log(np.log(2)) - gammaln(1 + x))",
        "test_weibull.py",
        "test_median_and_moments_by_quadrature",
    ),
    Mistake(
        "linear ring: conjugate of the contacts' answer",
        "mistuning/linear.py",
        "1j * (cs - sc)",
        "1j * (sc - cs)",
        "test_mistuning.py",
        "test_the_linear_ring_answers_as_contacts_do_on_average",
    ),
    Mistake(
        "quantile: an index of the interval's lower end",
        "mistuning/statistics.py",
        "float(x[low - 1]) if low else 0.0",
        "float(x[low]) if low else 0.0",
        "test_mistuning.py",
        "test_intervals_are_no_wider_than_they_must_be",
    ),
    # files
    Mistake(
        "deck in mm and t: the unit of mass",
        "units.py",
        '"mm-t-s": (1e-3, 1e3, 1.0)',
        '"mm-t-s": (1e-3, 1.0, 1.0)',
        "test_own_materials.py",
        "test_deck_and_settings_say_the_same_material",
    ),
    Mistake(
        "matrices of other units: power of time in the mass",
        "exchange/matrices/__init__.py",
        '"mass": time**2}',
        '"mass": time}',
        "test_matrices.py",
        "test_every_matrix_has_its_own_power_of_the_unit_of_time",
    ),
    Mistake(
        "universal file: order of the wedge's nodes",
        "mesh/unv.py",
        "(0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8)",
        "(0, 2, 4, 9, 11, 13, 1, 3, 5, 6, 7, 8, 10, 12, 14)",
        "test_readers.py",
        "test_cells_that_gmsh_writes_are_the_same_in_every_format",
    ),
    Mistake(
        "universal file: sign of the damping in an eigenvalue",
        "exchange/uff.py",
        "numbers = [-D * omega, damped,",
        "numbers = [D * omega, damped,",
        "test_exchange.py",
        "test_complex_modes_in_uff_keep_phase_and_eigenvalue",
    ),
    Mistake(
        "DMIG: sign of what a damping matrix has of gyroscopic",
        "exchange/dmig.py",
        "turned(g.G_r + (g.C_r - g.C_r.T) / 2)",
        "turned(g.G_r - (g.C_r - g.C_r.T) / 2)",
        "test_exchange_dmig.py",
        "test_gyroscopic_and_circulatory_matrices_are_square_and_a_damping_matrix_is_whole",
    ),
)


def copied(folder: Path) -> None:
    """Package and tests; what stands beside them is read alone, and linked."""
    for entry in ROOT.iterdir():
        if entry.name in ("pipeline", "tests"):
            shutil.copytree(entry, folder / entry.name)
        elif not entry.name.startswith(".") and entry.name != "build":
            (folder / entry.name).symlink_to(entry)


def failing(folder: Path, *tests: str) -> list[str]:
    """Of quick tests in a copy, the first one that fails. Programs are kept where `conftest` does.

    Raises:
        SystemExit: pytest does not run them.
    """
    programs = os.environ.get("JAX_COMPILATION_CACHE_DIR", str(ROOT / "build/programs-of-tests"))
    package = {"PYTHONPATH": str(folder / "pipeline"), "JAX_COMPILATION_CACHE_DIR": programs}
    how = ["-x", "-q", "-m", "not slow", "--tb=no", "-rfE", "-p", "no:cacheprovider"]
    asked = [sys.executable, "-m", "pytest", *how, *(f"tests/{test}" for test in tests)]
    given = {"cwd": folder, "env": os.environ | package, "capture_output": True, "text": True}
    ended = subprocess.run(asked, **given)
    failed = r"^(?:FAILED|ERROR) tests/(.+?::.+?)(?: - .*)?$"
    found = re.findall(failed, ended.stdout, re.MULTILINE)
    if ended.returncode != (1 if found else 0):
        said = f"{ended.stdout[-3000:]}{ended.stderr[-3000:]}"
        raise SystemExit(f"pytest ends with {ended.returncode}:\n{said}")
    return found


def caught(folder: Path, mistake: Mistake) -> list[str]:
    """Which test sees a mistake, if one does."""
    file = folder / "pipeline/microslip" / mistake.file
    right, made = file.read_text(encoding="utf-8"), file.stat().st_mtime
    file.write_text(right.replace(mistake.old, mistake.new), encoding="utf-8")
    try:
        return failing(folder, mistake.asked)
    finally:
        file.write_text(right, encoding="utf-8")
        os.utime(file, (made, made))  # so old that no byte code of the mistake is taken for it


def spent() -> float:
    """CPU seconds of what was started and has ended."""
    of = resource.getrusage(resource.RUSAGE_CHILDREN)
    return of.ru_utime + of.ru_stime


def main(numbers: list[int]) -> int:
    """Exit code."""
    seen, wrong = dict[str, None](), 0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made).resolve()
        copied(folder)
        for number, mistake in enumerate(MISTAKES, 1):
            if numbers and number not in numbers:
                continue
            text = (folder / "pipeline/microslip" / mistake.file).read_text(encoding="utf-8")
            if text.count(mistake.old) != 1:
                count, tests = text.count(mistake.old), list[str]()
                said = f"its old text stands {count} times in {mistake.file}; correct the table"
            else:
                begun = spent()
                tests = caught(folder, mistake)
                said = f"caught by {tests[0]}" if tests else f"SURVIVED {mistake.asked}"
                said += f" ({spent() - begun:.0f} CPU s)"
            seen |= dict.fromkeys(tests)
            wrong += not tests
            print(f"{number:2d} {mistake.what}: {said}", flush=True)
        if always := failing(folder, *seen) if seen else []:
            print(f"{always[0]} fails without a mistake as well")
    return int(bool(wrong or always))


if __name__ == "__main__":
    sys.exit(main([int(word) for word in sys.argv[1:]]))
