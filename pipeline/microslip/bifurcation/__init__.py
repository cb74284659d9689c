"""Bifurcations of smooth systems x' = f(x, p): `equilibria` and their Hopf points, periodic `orbits` by `shooting` on
the compiled `flow`, with their Floquet multipliers, and by harmonic `balance` with unknown frequency, attractors from
many starts (`basin`), orbits beside the known ones (`deflation`), all of them in a `diagram` of `branches`.

Knows no mechanics but for `mechanics`, which makes such a system of an assembly.
"""
