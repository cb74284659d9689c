"""All nodal diameters of the 24-blade shroud sector against as many real solves of the same sector.

    python benchmarks/cyclic.py                  # three meshes, some ten minutes
    python benchmarks/cyclic.py --quick          # one coarse mesh, seconds
    python benchmarks/cyclic.py --scales 1 --modes 40

"Cyclic": 13 nodal diameters, `modes` certified eigenmodes each, from one process. "Real": 13 certified solves of the
sector with its cut faces free, each with a fresh solver (analysis and factorisation of its own). Both read and assemble
once; what is compared is everything after K and M. Every measurement is a process of its own with one thread; the two
take turns, the median of the rounds counts, the ratio is taken within a round.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from pathlib import Path

import modal
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "bench"
SECTORS = 24
DIAMETERS = tuple(range(SECTORS // 2 + 1))
SIZES = {"pressure_side": 4.5, "suction_side": 4.5, "contact_left": 3.0, "contact_right": 3.0}  # mm, at scale 1
GOAL = 2.0


# ---------------------------------------------------------------- the two ways, each in its own process


def prepared(mesh_file: str, clock: modal.Clock):
    """Mesh, settings and model of the sector, and what both ways share."""
    with clock.stage("read"):
        from microslip.fem.discretise import discretise
        from microslip.mesh import read_mesh
        from microslip.modal.boundary import fixed_dofs
        from microslip.settings.body import BodySettings

        mesh = read_mesh(mesh_file, "mm")
    settings = BodySettings.model_validate(
        {
            "name": "shroud", "length_unit": "m", "geometry": {"mesh": mesh_file}, "supports": [{"face": "bore"}],
            "material": {"density": modal.DENSITY, "young": modal.YOUNG, "poisson": modal.POISSON},
            "cyclic": {"sectors": SECTORS},
        }
    )  # fmt: skip
    with clock.stage("pattern and gradients"):
        d = discretise(mesh)
    return d, settings, fixed_dofs(mesh, settings)


def model_of(d, settings, free, fixed, clock: modal.Clock):
    from microslip.modal.equilibrium import make_model

    with clock.stage("K and M"):
        rest = np.zeros((d.mesh.n_points, 3))
        return make_model(d, settings.material.material(), free, fixed, np.eye(3)[1], rest[0], None, 293.0, rest, True)


def cyclic_worker(mesh_file: str, modes: int, clock: modal.Clock) -> dict:
    from microslip.linalg import eigen
    from microslip.modal.sector import make_sector, sector_pencils
    from microslip.modal.solution import shared_shifts

    d, settings, fixed = prepared(mesh_file, clock)
    with clock.stage("unknowns"):
        sector = make_sector(d, settings, fixed, np.eye(3)[1], np.zeros(3))
    model = model_of(d, settings, sector.static, fixed, clock)
    with clock.stage("matrices"):
        pencils = sector_pencils(model, model.K0, sector.unknowns, sector.condensed, DIAMETERS)
    with clock.stage("condensation"):
        sector.condensed.factorise(pencils[0].shifted(0.0))
    found = {}
    for k, pencil in pencils.items():
        with clock.stage("search"):
            found[k] = eigen.search(pencil, modes, tolerance=modal.TOLERANCE)
    with clock.stage("certificate"):
        from dataclasses import replace

        shifts = shared_shifts([s.gap for s in found.values()])
        for k in sorted(found, key=lambda k: shifts[k]):
            found[k] = eigen.certify(pencils[k], replace(found[k], upper_shift=shifts[k]), tolerance=modal.TOLERANCE)
    return {
        "dof": pencils[0].n, "cut": len(sector.unknowns.boundary) // 2,
        "certified": all(s.certified for s in found.values()),
        "shifts": len(set(shifts)), "solves": sum(s.solves for s in found.values()),
        "frequencies": [(np.sqrt(s.values[:modes]) / 2 / np.pi).tolist() for s in found.values()],
    }  # fmt: skip


def real_worker(mesh_file: str, modes: int, clock: modal.Clock) -> dict:
    from microslip.fem.discretise import free_upper
    from microslip.linalg import eigen
    from microslip.modal.spectrum import make_pencil

    d, settings, fixed = prepared(mesh_file, clock)
    with clock.stage("unknowns"):
        free = free_upper(d.pattern, fixed)
    model = model_of(d, settings, free, fixed, clock)
    solves, certified = 0, True
    for _ in DIAMETERS:
        solver = eigen.new_solver()
        with clock.stage("matrices"):
            pencil = make_pencil(model, model.K0, modal.timed_solver(solver, clock))
        with clock.stage("search"):
            found = eigen.search(pencil, modes, tolerance=modal.TOLERANCE)
        with clock.stage("certificate"):
            found = eigen.certify(pencil, found, tolerance=modal.TOLERANCE)
        solves, certified = solves + found.solves, certified and found.certified
        solver.close()
    return {"dof": pencil.n, "certified": certified, "solves": solves}


STAGES = {
    "cyclic": ("matrices", "condensation", "search", "certificate"),
    "real": ("matrices", "search", "certificate"),  # the search factorises
}
WORKERS = {"cyclic": cyclic_worker, "real": real_worker}


# ---------------------------------------------------------------- the study


def mesh_at(scale: float) -> Path:
    """The shroud's sector, every size of its mesh times the scale; kept in the work folder."""
    path = WORK / f"shroud_{scale:g}.msh"
    if not path.exists():
        settings = path.with_suffix(".json")
        mesh = {"size": 10.0 * scale, "order": 2, "local": {k: v * scale for k, v in SIZES.items()}}
        settings.write_text(json.dumps({"name": "shroud", "length_unit": "mm", "mesh": mesh}))
        modal.run([sys.executable, str(ROOT / "geometry/shroud/build.py"), str(settings), str(path)], WORK)
    return path


def measured(way: str, mesh: Path, modes: int) -> dict:
    """A worker of this file in a process of its own."""
    answer = WORK / "answer.json"
    answer.unlink(missing_ok=True)
    command = [sys.executable, __file__, "--worker", way, str(mesh), str(modes), str(answer)]
    cpu, wall, memory = modal.run(command, WORK)
    result = json.loads(answer.read_text())
    return {**result, "process": (cpu, wall), "memory": memory, "job": modal.total(result["costs"], *STAGES[way])}


def study(scales: list[float], modes: int, rounds: int) -> list[dict[str, list[dict]]]:
    cases = []
    for scale in scales:
        mesh, case = mesh_at(scale), {way: [] for way in WORKERS}
        for number in range(rounds):
            print(f"scale {scale:g}, round {number + 1} of {rounds}", flush=True)
            for way in WORKERS:
                case[way].append(measured(way, mesh, modes))
        cases.append(case)
    return cases


def median(results: list[dict], *keys) -> float:
    def value(r):
        for key in keys:
            r = r[key]
        return r

    return statistics.median(value(r) for r in results)


def report(cases: list[dict[str, list[dict]]], modes: int) -> str:
    parts = [table_of_ratios(cases, modes), table_of_stages(cases)]
    if len(cases) > 1:
        parts.append(growth(cases))
    return "\n\n".join(parts)


def table_of_ratios(cases: list[dict[str, list[dict]]], modes: int) -> str:
    lines = [
        f"| dof of the sector | on a cut face | modes | 13 diameters, CPU s | wall s | GB | 13 real solves, CPU s "
        f"| wall s | GB | cyclic / real, CPU | goal {GOAL:g} |",
        "|" + "--:|" * 10 + "---|",
    ]
    for case in cases:
        a, b = case["cyclic"], case["real"]
        ratio = statistics.median(x["job"][0] / y["job"][0] for x, y in zip(a, b, strict=True))
        cells = [a[0]["dof"], a[0]["cut"], modes]
        cells += [f"{median(r, *key):.2f}" for r in (a, b) for key in (("job", 0), ("job", 1), ("memory",))]
        lines.append("| " + " | ".join(map(str, cells)) + f" | {ratio:.2f} | {'' if ratio <= GOAL else 'missed'} |")
    return "\n".join(lines)


def table_of_stages(cases: list[dict[str, list[dict]]]) -> str:
    names = ["read", "pattern and gradients", "unknowns", "K and M", "matrices", "condensation", "search"]
    lines = [
        "| dof | way | " + " | ".join(names) + " | certificate | right-hand sides | shifts |",
        "|--:|---|" + "--:|" * (len(names) + 3),
    ]
    for case in cases:
        for way, results in case.items():
            keys = [k for k in [*names, "certificate"] if k != "condensation" or way == "cyclic"]
            cells = [f"{median(results, 'costs', key, 0):.2f}" for key in keys]
            if way == "real":
                cells.insert(names.index("condensation"), f"({median(results, 'costs', 'factor', 0):.2f})")
            shifts = results[0].get("shifts", len(DIAMETERS))
            lines.append(f"| {results[0]['dof']} | {way} | {' | '.join(cells)} | {results[0]['solves']} | {shifts} |")
    lines += ["", "In brackets: the factorisations of the real solves, those of the search and of the certificate."]
    return "\n".join(lines)


def growth(cases: list[dict[str, list[dict]]]) -> str:
    def power(way: str, *keys) -> str:
        return f"{modal.exponent([(c[way][0]['dof'], median(c[way], *keys)) for c in cases]):.2f}"

    return (
        "Cost grows as a power of the degrees of freedom: "
        + ", ".join(f"{way} CPU {power(way, 'job', 0)}, memory {power(way, 'memory')}" for way in WORKERS)
        + f", condensation {power('cyclic', 'costs', 'condensation', 0)}"
    )


def work(way: str, mesh: str, modes: str, answer: str) -> None:
    """Body of a worker process."""
    clock = modal.Clock()
    with clock.stage("imports"):
        import skfem  # noqa: F401

        from microslip import modal as _  # noqa: F401
    result = WORKERS[way](mesh, int(modes), clock)
    Path(answer).write_text(json.dumps({**result, "costs": clock.costs}))


def main(argv: list[str] | None = None) -> None:
    global WORK
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scales", type=float, nargs="+", default=[2.0, 1.0, 0.5], help="of the mesh sizes")
    parser.add_argument("--modes", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one coarse mesh, 5 modes, one round")
    parser.add_argument("--work", type=Path, default=WORK, help="folder for meshes and results")
    arguments = parser.parse_args(argv)
    if arguments.quick:
        arguments.scales, arguments.modes, arguments.rounds = [3.0], 5, 1
    WORK = arguments.work.resolve()
    WORK.mkdir(parents=True, exist_ok=True)
    print(modal.machine())
    cases = study(arguments.scales, arguments.modes, arguments.rounds)
    (WORK / "cyclic.json").write_text(json.dumps(cases, indent=1))
    print("\n" + report(cases, arguments.modes) + f"\n\nload at the end: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        work(*sys.argv[2:])
    else:
        main()
