"""Run by the system's Python with Debian's python3-siconos: set-valued contact and friction by Moreau and Jean.

    python3 siconos_motion.py job.json out.json

job: M, C, K: (n, n). weight: (n,) N, always there. force: (n,) N, times cos(omega t). omega: rad/s. q, v: (n,) at the
start. contacts: a list of {normal: (n,) row, gap: m (normal q + gap >= 0), along: (n,) row of friction, mu,
restitution}. step, end: s.

out: time: (s,) after each step. q, v: (s, n). normal, friction: (s, contacts) impulses of the step over its length, N.

theta = 1/2, loads from the middle of each step, the friction problem to 1e-12.
"""

import json
import sys

import numpy as np
import siconos.kernel as sk
import siconos.numerics as sn

job = json.load(open(sys.argv[1]))
n, step = len(job["q"]), job["step"]
M, C, K, weight, force = (np.array(job[key], dtype=float) for key in ("M", "C", "K", "weight", "force"))
bodies = sk.LagrangianLinearTIDS(job["q"], job["v"], M)
bodies.setKPtr(K)
bodies.setCPtr(C)
model = sk.NonSmoothDynamicalSystem(0.0, job["end"])
model.insertDynamicalSystem(bodies)
contacts = []
for c in job["contacts"]:
    rows = sk.LagrangianLinearTIR(np.array([c["normal"], c["along"]], dtype=float), np.array([c["gap"], 0.0]))
    contacts.append(sk.Interaction(sk.NewtonImpactFrictionNSL(c["restitution"], 0.0, c["mu"], 2), rows))
    model.link(contacts[-1], bodies)
problem = sk.FrictionContact(2, sn.SICONOS_FRICTION_2D_ENUM if len(contacts) < 5 else sn.SICONOS_FRICTION_2D_NSGS)
problem.numericsSolverOptions().dparam[sn.SICONOS_DPARAM_TOL] = 1e-12
time = sk.TimeDiscretisation(0.0, step)
simulation = sk.TimeStepping(model, time, sk.MoreauJeanOSI(0.5), problem)
found = {key: [] for key in ("time", "q", "v", "normal", "friction")}
while simulation.hasNextEvent():
    push = weight + force * np.cos(job["omega"] * (simulation.nextTime() - 0.5 * step))
    bodies.setFExtPtr(push)
    simulation.computeOneStep()
    pressed = np.array([c.lambda_(1) for c in contacts]) / step
    for key, value in zip(found, (simulation.nextTime(), bodies.q(), bodies.velocity(), *pressed.T), strict=True):
        found[key].append(np.array(value).tolist())
    simulation.nextStep()
json.dump(found, open(sys.argv[2], "w"))
