"""pyNastran reads a superelement: its matrices, the rows they belong to, and the grids.

Usage: pynastran_dmig.py PUNCH OUT
"""

import sys

import numpy as np
from pyNastran.bdf.bdf import BDF

punch, out = sys.argv[1:]
model = BDF(debug=None)
model.read_bdf(punch, punch=True, xref=False)
found = {"GRID": np.array([[n, *g.xyz] for n, g in sorted(model.nodes.items())])}
assert all(g.cp == 0 and g.cd == 0 for g in model.nodes.values())
for name, card in model.dmig.items():
    matrix, rows, _ = card.get_matrix(is_sparse=False)
    found |= {name: matrix, f"{name}_rows": np.array([rows[i] for i in range(len(matrix))])}
np.savez(out, **found)
