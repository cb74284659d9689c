"""Run by pyHarm's own interpreter: force and derivative of three-dimensional contact elements, point by point.

    python pyharm_contacts.py points.npz out.npz

points: (n, 3, 2 H + 1) displacement, samples, stiffnesses, mu. Its element has the gap opening, a preload N0 and
both sides' coordinates; here the other side is the ground. It marches three cycles, and the solver asks for the
residual and for its derivative at every iteration: both calls are timed, and each after its compilation.
"""

import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from pyHarm.DynamicOperator import compute_DFT  # noqa: E402
from pyHarm.Elements.NodeToNodeElements.Penalty3D import evalResidual_jax, jaxf  # noqa: E402

job = np.load(sys.argv[1])
u, samples, preload = job["u"], int(job["samples"]), float(job["preload"])
n, _, size = u.shape
operators = compute_DFT(samples, size // 2)
select = np.zeros((3, size, 3 * size))
for direction in range(3):
    select[direction, :, direction * size : (direction + 1) * size] = np.eye(size)
here, ground = np.eye(3 * size), np.zeros((3 * size, 3 * size))
x = u.copy()
x[:, 0] *= -1  # its gap opens with the coordinate, and N0 presses at zero
x[:, 0, 0] += preload / float(job["normal"])
x = x.reshape(n, -1)


def call(function, row):
    return np.asarray(function(
        row, 1.0, select, here, ground, float(job["mu"]), preload, 0.0, float(job["normal"]), float(job["tangential"]),
        operators["ft"], operators["tf"],
    ))  # fmt: skip


started = time.perf_counter()
call(evalResidual_jax, x[0]), call(jaxf, x[0])
compiled = time.perf_counter() - started
wall, cpu = [], []
for _ in range(int(job["rounds"])):
    started = time.perf_counter(), time.process_time()
    force = [call(evalResidual_jax, row) for row in x]
    slope = [call(jaxf, row) for row in x]
    wall.append(time.perf_counter() - started[0])
    cpu.append(time.process_time() - started[1])
force = np.array(force).reshape(n, 3, size)
force[:, 0] *= -1
force[:, 0, 0] += preload
slope = np.array(slope).reshape(n, 3, size, 3, size)
slope[:, 0] *= -1
slope[:, :, :, 0] *= -1
np.savez(sys.argv[2], force=force, slope=slope, wall=wall, cpu=cpu, compiled=compiled, cycles=3)
