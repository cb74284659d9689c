"""Time and memory of the lowest modes of the test blade, beside CalculiX and NGSolve on the same mesh.

    python benchmarks/modal.py                   # everything, some fifteen minutes
    python benchmarks/modal.py --quick           # one coarse mesh, seconds
    python benchmarks/modal.py --sizes 130e3 --modes 20 --peers calculix

Every measurement is a process of its own with one thread; peers take turns, the median of the rounds counts.
CPU seconds are compared (user and system), wall seconds stand beside them. "Job" of microslip: read the mesh,
assemble, factorise, solve, without the start of Python; the certificate is timed apart. "Job" of CalculiX: the
whole process. "Job" of NGSolve: assemble, factorise, solve; handing the mesh over is not counted.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import re
import resource
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "bench"
YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0
TOLERANCE = 1e-9  # of all eigensolvers that have one
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NGS", "CCX_NPROC_EQUATION_SOLVER")}
LARGE = 200e3  # degrees of freedom from which one round has to do
PEERS = ("calculix", "ngsolve")

Costs = dict[str, tuple[float, float]]  # stage -> CPU and wall seconds
Case = tuple[int, int]  # degrees of freedom, modes


# ---------------------------------------------------------------- the three programs, each in its own process


class Clock:
    """CPU and wall seconds of named stages."""

    def __init__(self) -> None:
        self.costs: Costs = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        before = self.costs.get(name, (0.0, 0.0))
        self.costs[name] = (before[0] + time.process_time() - cpu, before[1] + time.perf_counter() - wall)


def microslip_worker(mesh_file: str, modes: int) -> dict:
    """Read, assemble, factorise, solve and certify the blade clamped at its root, stage by stage."""
    clock = Clock()
    with clock.stage("imports"):
        import meshio  # noqa: F401
        import skfem  # noqa: F401

        from microslip.fem.discretise import discretise, free_upper
        from microslip.linalg import eigen
        from microslip.mesh import read_mesh
        from microslip.modal.equilibrium import make_model
        from microslip.modal.spectrum import make_pencil
        from microslip.settings.body import MaterialSettings

        solver = timed_solver(eigen.new_solver(), clock)
    with clock.stage("read"):
        mesh = read_mesh(mesh_file, "mm")
    with clock.stage("pattern and gradients"):
        d = discretise(mesh)
        fixed = (3 * mesh.face_points("clamp")[:, None] + np.arange(3)).reshape(-1)
        free = free_upper(d.pattern, fixed)
    with clock.stage("K and M"):
        material = MaterialSettings(density=DENSITY, young=YOUNG, poisson=POISSON).material()
        rest = np.zeros((mesh.n_points, 3))
        model = make_model(d, material, free, fixed, np.eye(3)[1], rest[0], None, 293.0, rest, True)
    with clock.stage("supports"):
        pencil = make_pencil(model, model.K0, solver)
    with clock.stage("search"):
        found = eigen.search(pencil, modes, tolerance=TOLERANCE)
    searched = dict(clock.costs)
    with clock.stage("certificate"):
        found = eigen.certify(pencil, found, tolerance=TOLERANCE)
    return {
        "costs": {**searched, "certificate": clock.costs["certificate"]},
        "dof": pencil.n,
        "solves": found.solves,
        "certified": found.certified,
        "backward_error": float(found.backward_error.max()),
        "frequencies": (np.sqrt(found.values[:modes]) / 2 / np.pi).tolist(),
        "solver": solver.name,
    }


def timed_solver(inner, clock: Clock):
    """The same direct solver; the clock gets the stages ``factor`` and ``solves`` (the eigensolve's yardstick)."""
    from microslip.linalg.direct import DirectSolver

    class Timed(DirectSolver):
        name = inner.name

        def factorise(self, upper) -> None:
            with clock.stage("factor"):
                inner.factorise(upper)

        def solve(self, b):
            with clock.stage("solves"):
                return inner.solve(b)

        def negative(self) -> int:
            return inner.negative()

    return Timed()


def ngsolve_worker(arrays_file: str, modes: int, solver: str) -> dict:
    """The same space by NGSolve: second-order H1 on straight tetrahedra, sparsecholesky, `eigsh` or its Arnoldi."""
    clock = Clock()
    with clock.stage("imports"):
        try:
            import ngsolve as ng
        except ImportError as error:
            return {"skipped": str(error)}
    with clock.stage("mesh"):
        mesh = ngsolve_mesh(ng, np.load(arrays_file))
    with clock.stage("assembly"):
        space = ng.VectorH1(mesh, order=2, dirichlet="clamp")
        u, v = space.TnT()

        def strain(w):
            return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

        mu, lam = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
        elastic = 2 * mu * ng.InnerProduct(strain(u), strain(v)) + lam * ng.div(u) * ng.div(v)
        K = ng.BilinearForm(elastic * ng.dx, symmetric=True).Assemble()
        mass = ng.dx(bonus_intorder=-2)  # four points, as microslip and CalculiX take
        M = ng.BilinearForm(DENSITY * u * v * mass, symmetric=True).Assemble()
    free = np.flatnonzero(np.array(space.FreeDofs()))
    if solver == "arnoldi":
        with clock.stage("eigensolve"):  # factorises by itself
            vectors = [ng.BaseVector(space.ndof, complex=True) for _ in range(modes)]
            values = ng.ArnoldiSolver(K.mat, M.mat, space.FreeDofs(), vectors, 0.0, inverse="sparsecholesky")
        values = np.real(np.array(values))[:modes]
    else:
        with clock.stage("factor"):
            inverse = K.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
        with clock.stage("eigensolve"):
            values = ngsolve_eigsh(K.mat, M.mat, inverse, free, modes)
    frequencies = np.sort(np.sqrt(np.abs(values))) / 2 / np.pi
    return {"costs": clock.costs, "dof": len(free), "frequencies": frequencies.tolist()}


def ngsolve_mesh(ng, arrays):
    import netgen.meshing as netgen

    mesh = netgen.Mesh(dim=3)
    mesh.AddPoints(arrays["points"])
    mesh.AddElements(dim=3, index=1, data=arrays["tetrahedra"], base=0)
    for number, name in enumerate(("clamp", "free")):
        index = mesh.Add(netgen.FaceDescriptor(surfnr=number + 1, bc=number + 1, domin=1))
        mesh.SetBCName(number, name)
        mesh.AddElements(dim=2, index=index, data=arrays[name], base=0)
    return ng.Mesh(mesh)


def ngsolve_eigsh(K, M, inverse, free, modes: int):
    from scipy.sparse.linalg import LinearOperator, eigsh

    x, y = K.CreateColVector(), K.CreateColVector()
    inside, outside = x.FV().NumPy(), y.FV().NumPy()

    def operator(A) -> LinearOperator:
        def product(b):
            inside[:] = 0.0
            inside[free] = b.reshape(-1)
            y.data = A * x
            return outside[free]

        return LinearOperator((len(free), len(free)), matvec=product, dtype=float)

    start = np.random.default_rng(2007).standard_normal(len(free))
    return eigsh(
        operator(K), k=modes, M=operator(M), sigma=0.0, OPinv=operator(inverse), ncv=2 * modes + 1, v0=start,
        tol=TOLERANCE, return_eigenvectors=True,
    )[0]  # fmt: skip


# ---------------------------------------------------------------- starting them


def run(command: list[str], folder: Path) -> tuple[float, float, float]:
    """CPU seconds, wall seconds and peak memory (GB) of a process with one thread, its output in log.txt."""
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(ROOT / "pipeline")}
    began = time.perf_counter()
    with open(folder / "log.txt", "w") as log:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(command)} failed:\n" + (folder / "log.txt").read_text()[-2000:])
    unit = 1e-9 if sys.platform == "darwin" else 1.024e-6
    return used.ru_utime + used.ru_stime, time.perf_counter() - began, used.ru_maxrss * unit


def measured(python: str, *arguments: str) -> dict:
    """A worker of this file in a process of its own; its answer with the process' CPU, wall and memory."""
    answer = WORK / "answer.json"
    answer.unlink(missing_ok=True)
    cpu, wall, memory = run([python, __file__, "--worker", *arguments, str(answer)], WORK)
    return {**json.loads(answer.read_text()), "process": (cpu, wall), "memory": memory}


def run_microslip(mesh: Path, modes: int) -> dict:
    result = measured(sys.executable, "microslip", str(mesh), str(modes))
    return {**result, "job": total(result["costs"], "read", "pattern and gradients", "K and M", "supports", "search")}


def run_ngsolve(mesh: Path, modes: int, python: str, solver: str) -> dict:
    result = measured(python, "ngsolve", str(mesh.with_suffix(".npz")), str(modes), solver)
    if "skipped" in result:
        return result
    return {**result, "eigensolver": solver, "job": total(result["costs"], "assembly", "factor", "eigensolve")}


def run_calculix(mesh: Path, modes: int) -> dict:
    deck = mesh.with_suffix(".inp").read_text() + f"*STEP\n*FREQUENCY\n{modes}\n*END STEP\n"
    (WORK / "job.inp").write_text(deck)
    cpu, wall, memory = run(["ccx", "job"], WORK)
    return {"job": (cpu, wall), "memory": memory, "frequencies": calculix_frequencies(WORK / "job.dat", modes)}


def calculix_frequencies(path: Path, modes: int) -> list[float]:
    """Cycles per time of the first table of a .dat file."""
    rows = [line.split() for line in path.read_text().splitlines()]
    return [float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()][:modes]


def total(costs: Costs, *stages: str) -> tuple[float, float]:
    chosen = [costs[s] for s in stages if s in costs]
    return sum(c for c, _ in chosen), sum(w for _, w in chosen)


# ---------------------------------------------------------------- meshes


def mesh_near(dof: float) -> tuple[Path, int]:
    """A blade mesh with about so many degrees of freedom (10 %), and how many it has; kept in build/bench."""
    size = 6.0 * math.sqrt(80e3 / dof)
    best: tuple[float, Path, int] | None = None
    for _ in range(6):
        path = WORK / f"blade_{size:.3g}.msh"
        if not path.exists():
            build_mesh(path, size)
        found = 3 * nodes_of(path)
        if best is None or abs(found - dof) < best[0]:
            best = abs(found - dof), path, found
        if best[0] < 0.1 * dof:
            break
        size *= (found / dof) ** 0.45
    assert best is not None
    write_inputs(best[1])
    return best[1], best[2]


def build_mesh(path: Path, size: float) -> None:
    settings = path.with_suffix(".json")
    settings.write_text(json.dumps({"name": "blade", "length_unit": "mm", "mesh": {"size": size, "order": 2}}))
    run([sys.executable, str(ROOT / "geometry" / "blade" / "build.py"), str(settings), str(path)], WORK)


def nodes_of(path: Path) -> int:
    with open(path) as file:
        for line in file:
            if line.startswith("$Nodes"):
                return int(next(file).split()[1])
    raise ValueError(f"{path} holds no nodes")


def write_inputs(path: Path) -> None:
    """The same mesh for CalculiX (all but the step) and as arrays for NGSolve (its corners)."""
    if path.with_suffix(".inp").exists() and path.with_suffix(".npz").exists():
        return
    from microslip.mesh import boundary_facets, read_mesh

    mesh = read_mesh(path, "mm")
    cells, clamp = mesh.cells["tetra10"], mesh.face_points("clamp")
    with open(path.with_suffix(".inp"), "w") as f:
        f.write("*NODE\n")
        f.writelines(f"{i},{x:.12e},{y:.12e},{z:.12e}\n" for i, (x, y, z) in enumerate(mesh.points, 1))
        f.write("*ELEMENT,TYPE=C3D10,ELSET=ALL\n")
        f.writelines(f"{i},{','.join(map(str, c + 1))}\n" for i, c in enumerate(cells, 1))
        f.write("*NSET,NSET=CLAMP\n" + "".join(f"{i + 1},\n" for i in clamp))
        f.write(f"*MATERIAL,NAME=STEEL\n*ELASTIC\n{YOUNG},{POISSON}\n*DENSITY\n{DENSITY}\n")
        f.write("*SOLID SECTION,ELSET=ALL,MATERIAL=STEEL\n*BOUNDARY\nCLAMP,1,3\n")
    corners = np.unique(cells[:, :4])
    number = np.zeros(mesh.n_points, dtype=np.int32)
    number[corners] = np.arange(len(corners))
    facets = boundary_facets(mesh)["triangle6"][:, :3]
    held = np.isin(facets, clamp).all(axis=1)
    np.savez(
        path.with_suffix(".npz"), points=mesh.points[corners], tetrahedra=number[cells[:, :4]],
        clamp=number[facets[held]], free=number[facets[~held]],
    )  # fmt: skip


# ---------------------------------------------------------------- the study


def study(arguments: argparse.Namespace) -> dict[Case, dict[str, list[dict]]]:
    """All cases: results of every program, one entry a round."""
    runs: dict[Case, dict[str, list[dict]]] = {}
    for target in arguments.sizes:
        mesh, dof = mesh_near(target)
        for modes in arguments.modes:
            rounds = 1 if arguments.quick or dof > LARGE or modes != arguments.modes[0] else 3
            case = runs.setdefault((dof, modes), {})
            for number in range(rounds):
                print(f"{dof} degrees of freedom, {modes} modes, round {number + 1} of {rounds}", flush=True)
                one_round(case, mesh, modes, arguments, first=number == 0 and dof < LARGE)
            (WORK / "modal.json").write_text(json.dumps([[*c, r] for c, r in runs.items()], indent=1))
    return runs


def one_round(case: dict[str, list[dict]], mesh: Path, modes: int, arguments, first: bool) -> None:
    case.setdefault("microslip", []).append(run_microslip(mesh, modes))
    if "calculix" in arguments.peers:
        case.setdefault("CalculiX", []).append(run_calculix(mesh, modes))
    if "ngsolve" in arguments.peers:
        for solver in ("eigsh", "arnoldi") if first else (arguments.ngsolve_solver,):
            result = run_ngsolve(mesh, modes, arguments.ngsolve_python, solver)
            if "skipped" in result:
                print(f"NGSolve is left out: {result['skipped']} (pip install ngsolve)")
                arguments.peers = tuple(p for p in arguments.peers if p != "ngsolve")
                return
            case.setdefault(f"NGSolve {solver}", []).append(result)
        if first:
            arguments.ngsolve_solver = best_ngsolve(case)[len("NGSolve ") :]


def best_ngsolve(case: dict[str, list[dict]]) -> str:
    """The faster of its two eigensolvers among those whose frequencies are right."""
    names = [n for n in case if n.startswith("NGSolve")]
    right = [n for n in names if difference(case, n) < 1e-5] or names
    return min(right, key=lambda n: job(case[n])[0])


def difference(case: dict[str, list[dict]], name: str) -> float:
    """Largest relative difference of a program's frequencies from microslip's."""
    a, b = (np.array(case[n][0]["frequencies"]) for n in (name, "microslip"))
    return float(np.abs(a[: len(b)] / b[: len(a)] - 1).max()) if len(a) == len(b) else math.inf


def median(results: list[dict], value: Callable[[dict], float]) -> float:
    return statistics.median(value(r) for r in results)


def job(results: list[dict]) -> tuple[float, float]:
    """CPU and wall seconds, medians over the rounds."""
    return median(results, lambda r: r["job"][0]), median(results, lambda r: r["job"][1])


def cpu(*stages: str) -> Callable[[dict], float]:
    return lambda r: total(r["costs"], *stages)[0]


def stage(name: str, clock: int) -> Callable[[dict], float]:
    return lambda r: r["costs"][name][clock]


ASSEMBLY = ("pattern and gradients", "K and M", "supports")


def shares(results: list[dict]) -> dict[str, float]:
    """The ratios of microslip to itself, medians of the ratio in each round."""
    whole = lambda r: r["job"][0]  # noqa: E731
    return {
        "certificate": median(results, lambda r: cpu("certificate")(r) / whole(r)),
        "assembly": median(results, lambda r: cpu(*ASSEMBLY)(r) / whole(r)),
        "yardstick": median(results, lambda r: cpu("search")(r) / cpu("factor", "solves")(r)),
    }


def exponent(points: list[tuple[float, float]]) -> float:
    """Slope of log cost over log size."""
    n, cost = np.log(np.array(points)).T
    return float(np.polyfit(n, cost, 1)[0])


# ---------------------------------------------------------------- printing


def report(runs: dict[Case, dict[str, list[dict]]]) -> str:
    parts = [table_of_jobs(runs), table_of_stages(runs), table_of_goals(runs), growth(runs)]
    return "\n\n".join(p for p in parts if p)


def table_of_jobs(runs: dict[Case, dict[str, list[dict]]]) -> str:
    lines = [
        "| dof | modes | program | CPU s | wall s | GB | CPU / microslip | wall / microslip | largest df/f |",
        "|--:|--:|---|--:|--:|--:|--:|--:|--:|",
    ]
    for (dof, modes), case in runs.items():
        ours = job(case["microslip"])
        for name, results in case.items():
            cost, memory = job(results), median(results, lambda r: r["memory"])
            apart = "" if name == "microslip" else f"{difference(case, name):.0e}"
            ratios = f"{cost[0] / ours[0]:.2f} | {cost[1] / ours[1]:.2f}"
            lines.append(
                f"| {dof} | {modes} | {name} | {cost[0]:.2f} | {cost[1]:.2f} | {memory:.2f} | {ratios} | {apart} |"
            )
    return "\n".join(lines)


def table_of_stages(runs: dict[Case, dict[str, list[dict]]]) -> str:
    """CPU seconds (wall in brackets) of microslip's stages."""
    names = ["imports", "read", *ASSEMBLY, "factor", "solves", "search", "certificate"]
    lines = ["| dof | modes | " + " | ".join(names) + " | right-hand sides |", "|--:" * (len(names) + 3) + "|"]
    for (dof, modes), case in runs.items():
        results = case["microslip"]
        cells = [f"{median(results, stage(n, 0)):.2f} ({median(results, stage(n, 1)):.2f})" for n in names]
        lines.append(f"| {dof} | {modes} | " + " | ".join(cells) + f" | {results[0]['solves']} |")
    return "\n".join(lines)


def table_of_goals(runs: dict[Case, dict[str, list[dict]]]) -> str:
    lines = ["| dof | modes | measure | goal | found | |", "|--:|--:|---|--:|--:|---|"]
    for (dof, modes), case in runs.items():
        for what, goal, found, met in goals(dof, case):
            lines.append(f"| {dof} | {modes} | {what} | {goal} | {found} | {'' if met else 'missed'} |")
    return "\n".join(lines)


def goals(dof: int, case: dict[str, list[dict]]) -> Iterator[tuple[str, str, str, bool]]:
    """(what, goal, found, met) of one case. Speed-ups are asked for up to 200 000 degrees of freedom."""
    ours = job(case["microslip"])[0]
    if "CalculiX" in case:
        ratio = job(case["CalculiX"])[0] / ours
        yield "CalculiX / microslip, CPU", "> 3.5", f"{ratio:.2f}", ratio > 3.5 or dof > LARGE
    if any(n.startswith("NGSolve") for n in case):
        name = best_ngsolve(case)
        ratio, goal = job(case[name])[0] / ours, 1.5 if dof < 80e3 else 2.0
        yield f"{name} / microslip, CPU", f"> {goal}", f"{ratio:.2f}", ratio > goal or dof > LARGE
    part = shares(case["microslip"])
    yield "certificate on top", "< 25 %", f"{100 * part['certificate']:.0f} %", part["certificate"] < 0.25
    yield "assembly", "< 20 %", f"{100 * part['assembly']:.0f} %", part["assembly"] < 0.2
    yield "eigensolve / (factor + solves)", "< 1.25", f"{part['yardstick']:.2f}", part["yardstick"] < 1.25
    memory = median(case["microslip"], lambda r: r["memory"])
    yield "peak memory, GB", "< 6", f"{memory:.2f}", memory < 6


def growth(runs: dict[Case, dict[str, list[dict]]]) -> str:
    """Fitted exponents over the sizes, for the first number of modes."""
    modes = next(iter(runs))[1]
    cases = {dof: case for (dof, m), case in runs.items() if m == modes}
    if len(cases) < 2:
        return ""
    measures: dict[str, Callable[[dict], float]] = {
        "assembly": cpu(*ASSEMBLY),
        "factor with analysis": cpu("factor"),
        "factor again (certificate)": cpu("certificate"),
        "one solve": lambda r: cpu("solves")(r) / r["solves"],
        "memory": lambda r: r["memory"],
        "job": lambda r: r["job"][0],
    }
    found = {k: exponent([(n, median(c["microslip"], f)) for n, c in cases.items()]) for k, f in measures.items()}
    if all("CalculiX" in c for c in cases.values()):
        found["CalculiX' job"] = exponent([(n, job(c["CalculiX"])[0]) for n, c in cases.items()])
    return "Cost grows as a power of the degrees of freedom: " + ", ".join(f"{k} {v:.2f}" for k, v in found.items())


def machine() -> str:
    """Processor, cores, load and versions."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*:\s*(.*)", info.read_text()) if info.exists() else None
    versions = []
    for package in ("numpy", "scipy", "scikit-fem", "pypardiso", "mkl", "gmsh", "ngsolve"):
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            continue
    if shutil.which("ccx"):
        answer = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.split()
        versions.append(f"CalculiX {answer[-1]}" if answer else "CalculiX")
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    return (
        f"{found.group(1) if found else platform.processor()}, {os.cpu_count()} cores, {platform.system()} "
        f"{platform.release()}, Python {platform.python_version()}, load {load}\n" + ", ".join(versions)
    )


def parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=float, nargs="+", default=[40e3, 130e3, 400e3], help="degrees of freedom")
    parser.add_argument("--modes", type=int, nargs="+", default=[20, 40])
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=PEERS)
    parser.add_argument("--quick", action="store_true", help="8000 degrees of freedom, 10 modes, one round")
    parser.add_argument("--work", type=Path, default=WORK, help="folder for meshes and results")
    parser.add_argument("--ngsolve-python", default=sys.executable, help="a Python that has NGSolve, numpy and scipy")
    arguments = parser.parse_args(argv)
    if arguments.quick:
        arguments.sizes, arguments.modes = [8e3], [10]
    arguments.ngsolve_solver = "eigsh"
    if "calculix" in arguments.peers and not shutil.which("ccx"):
        print("CalculiX is left out: no ccx on the path (apt install calculix-ccx)")
        arguments.peers = tuple(p for p in arguments.peers if p != "calculix")
    return arguments


def main(argv: list[str] | None = None) -> None:
    global WORK
    arguments = parse(argv)
    WORK = arguments.work.resolve()
    sys.path.insert(0, str(ROOT / "pipeline"))
    WORK.mkdir(parents=True, exist_ok=True)
    print(machine())
    runs = study(arguments)
    print("\n" + report(runs) + f"\n\nload at the end: {os.getloadavg()[0]:.1f}")


def work(name: str, mesh: str, modes: str, *rest: str) -> None:
    """Body of a worker process; the last argument is the file for the answer."""
    *options, answer = rest
    worker = {"microslip": microslip_worker, "ngsolve": ngsolve_worker}[name]
    result = worker(mesh, int(modes), *options)
    result["memory_inside"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    Path(answer).write_text(json.dumps(result))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        work(*sys.argv[2:])
    else:
        main()
