"""Writes joint/parts.inp and joint/joint.inp: two plates that a bolt holds together, as Abaqus has them."""

import itertools

corner = (
    (-1, -1, -1),
    (1, -1, -1),
    (1, 1, -1),
    (-1, 1, -1),
    (-1, -1, 1),
    (1, -1, 1),
    (1, 1, 1),
    (-1, 1, 1),
)
edge = (
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 0),
    (4, 5),
    (5, 6),
    (6, 7),
    (7, 4),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
)
brick = [
    *corner,
    *(tuple((a + b) // 2 for a, b in zip(corner[i], corner[j], strict=False)) for i, j in edge),
]


def part(name, x, y, z, surfaces, keep, system=()):
    """Bricks between planes, mm. A surface: which of them (i, j, k), and their side S1 (below) or S2 (above)."""
    cells = [c for c in itertools.product(*(range(len(v) - 1) for v in (x, y, z))) if keep(*c)]
    keys = [
        [tuple(2 * c + 1 + d for c, d in zip(cell, node, strict=False)) for node in brick]
        for cell in cells
    ]
    number = {key: i for i, key in enumerate(sorted({key for nodes in keys for key in nodes}), 1)}
    lines = [f"*Part, name={name}", *system, "*Node"]
    for key, i in number.items():
        lines.append(
            f"{i}, "
            + ", ".join(
                str((v[k // 2] + v[-(-k // 2)]) / 2) for v, k in zip((x, y, z), key, strict=False)
            )
        )
    lines.append("*Element, type=C3D20R, elset=All")
    for i, nodes in enumerate(keys, 1):
        words = [i, *(number[key] for key in nodes)]
        lines += [", ".join(map(str, words[:16])) + ",", ", ".join(map(str, words[16:]))]
    for label, (chosen, side) in surfaces.items():
        lines.append(f"*Surface, type=ELEMENT, name={label}")
        lines += [f"{i}, {side}" for i, cell in enumerate(cells, 1) if chosen(*cell)]
    lines += ["*Nset, nset=End", *(f"{i}," for key, i in number.items() if key[0] == 0)]
    return [*lines, "*Solid Section, elset=All, material=Steel", ",", "*End Part"]


def lap(i, j, k):
    return i >= 4


steps = [0, 20, 40, 55, 70, 78, 83, 87, 92, 100]


def hole(i, j, k):
    return (i, j) != (6, 2)


parts = part(
    "Plate", steps, [0, 4, 8, 12, 16, 20], [0, 5], {"Top": (lap, "S2"), "Bottom": (lap, "S1")}, hole
)


def shank(i, j, k):
    return k in (0, 3) or (i, j) == (1, 1)


faces = {
    "Head": (lambda i, j, k: k == 3 and (i, j) != (1, 1), "S1"),
    "Nut": (lambda i, j, k: k == 0 and (i, j) != (1, 1), "S2"),
    "Cut": (lambda i, j, k: k == 1, "S2"),
}
local = [
    "*System",
    "85., 10., -3., 85., 11., -3.",
    "84., 10., -3.",
]  # origin and x axis, a point of the xy plane
parts += part("Bolt", [-3, -1, 1, 3], [-3, -1, 1, 3], [0, 3, 8, 13, 16], faces, shank, local)
open("joint/parts.inp", "w").write("\n".join(parts) + "\n")
open("joint/joint.inp", "w").write("""*Heading
two plates and a bolt
*Include, input=parts.inp
*Assembly, name=Assembly
*Instance, name=Lower, part=Plate
*End Instance
*Instance, name=Upper, part=Plate
0., 0., 5.
85., 10., 0., 85., 10., 1., 180.
*End Instance
*Instance, name=Bolt, part=Bolt
*End Instance
*Node, nset=Wall
1, -5., 10., 2.5
*Node, nset=Tension
2, 85., 10., 5.
*Nset, nset=Foot, instance=Lower
End,
*Surface, type=NODE, name=Foot
Foot,
*Coupling, constraint name=Clamp, ref node=Wall, surface=Foot
*Kinematic
*Tie, name=Thread, position tolerance=0.1
Bolt.Head, Upper.Top
*Equation
2
Upper.1, 3, 1., Upper.33, 3, -1.
*Pre-tension Section, surface=Bolt.Cut, node=Tension
*End Assembly
*Material, name=Steel
*Density
7.85e-9,
*Elastic
210000., 0.3
*Surface Interaction, name=Dry
*Friction
0.15,
*Contact Pair, interaction=Dry
Upper.Bottom, Lower.Top
Bolt.Nut, Lower.Bottom
*Boundary
Wall, 1, 6
*Step
*Static
*Cload
Tension, 1, 800.
*End Step
""")
