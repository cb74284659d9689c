"""FMPy validates a unit, compiles its source with the standard's own header before it, and runs it both ways.

Usage: fmpy_step.py UNIT OUT
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

unit, out = sys.argv[1:]
found = {"problems": np.array(validate_fmu(unit), dtype=str)}
header = Path(fmpy.__file__).parent / "c-code"
with tempfile.TemporaryDirectory() as folder:
    sources = Path(extract(unit, unzipdir=folder)) / "sources"
    command = ["cc", "-std=c99", "-fsyntax-only", "-Werror", f"-I{header}", "-include", "fmi2Functions.h", "body.c"]
    subprocess.run(command, cwd=sources, check=True)
span = read_model_description(unit).defaultExperiment
stop, step = float(span.stopTime), float(span.stepSize)
for way in ("ModelExchange", "CoSimulation"):
    answer = simulate_fmu(
        unit, fmi_type=way, stop_time=stop, output_interval=step, step_size=step, relative_tolerance=1e-8,
        start_values={"interface.right.u_n.force": 4.0},
        output=["monitor.tip_probe.u_x.displacement", "monitor.tip_probe.u_x.velocity"],
    )  # fmt: skip
    found[way] = np.array(answer.tolist())
np.savez(out, **found)
