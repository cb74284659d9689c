"""Pressure of an elastic half-space by tamaas: a job as JSON on stdin, {"pressure": ...} in the last line on stdout.

The job: undeformed distance (n, n) m, side of an element m, Young's modulus Pa, Poisson's ratio, force N.
"""

import json
import sys

import numpy as np
import tamaas

job = json.load(sys.stdin)
distance = np.array(job["distance"])
size = [job["side"] * n for n in distance.shape]
model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, size, list(distance.shape))
model.E, model.nu = job["young"], job["poisson"]
tamaas.ModelFactory.registerNonPeriodic(model, "free")
by_pressure = tamaas.PolonskyKeerRey.pressure
solver = tamaas.PolonskyKeerRey(model, -distance, 1e-14, by_pressure, by_pressure)
solver.setIntegralOperator("free")
solver.solve(job["force"] / np.prod(size))
print(json.dumps({"pressure": np.asarray(model.traction).tolist()}))
