"""What the kept modes hold of the static compliance, against a chain of springs whose modes are all known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import small

from microslip.data import Compliance, Interface, ModalGroup
from microslip.reduced.truncation import Coordinate, coordinates, percent, verdict


def chain(keep: int, n: int = 12) -> ModalGroup:
    """A clamped-free chain of unit masses and springs; contacts push on its middle and on its end."""
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[-1, -1] = 1.0
    values, phi = np.linalg.eigh(K)
    pick = np.zeros((2, n))
    pick[0, n - 1], pick[1, n // 2] = 1.0, -1.0
    T, static = pick @ phi[:, :keep], pick @ np.linalg.solve(K, pick.T)
    omega = np.sqrt(values[:keep])
    template = small.basis().groups[0, 0]
    interfaces = {
        name: _interface(T[i], name, partner)
        for i, (name, partner) in enumerate((("right", "left"), ("left", "right")))
    }
    labels = ("interface:right:u_n", "interface:left:u_n")
    return dataclasses.replace(
        template, omega=omega, kind=("normal",) * keep, interfaces=interfaces, excitations={}, monitors={},
        compliance=Compliance(labels, static, (T / omega**2) @ T.T, False),
    )  # fmt: skip


def _interface(normal: np.ndarray, role: str, partner: str) -> Interface:
    m = len(normal)
    rows = np.zeros((6, m))
    rows[0] = normal
    empty = np.zeros((0, 3))
    return Interface(
        np.zeros(3),
        np.eye(3),
        rows,
        np.zeros(m),
        empty,
        np.zeros(0),
        empty,
        np.zeros((0, 3, m)),
        role=role,
        partner=partner,
    )


def test_all_modes_hold_everything() -> None:
    for c in coordinates(chain(12)):
        assert c.share == pytest.approx(1.0, rel=1e-12)
        assert c.residual == pytest.approx(0.0, abs=1e-12 * c.static)
        assert (np.diff(c.shares) >= 0).all()


@pytest.mark.parametrize("keep", [1, 3, 7])
def test_shares_are_those_of_the_modal_sum(keep: int) -> None:
    group = chain(keep)
    right, left, squeezed = coordinates(group)
    for i, c in enumerate((right, left)):
        assert c.modal == pytest.approx(group.compliance.modal[i, i], rel=1e-12)
        assert c.static == pytest.approx(group.compliance.static[i, i], rel=1e-12)
        assert c.share == pytest.approx(c.modal / c.static, rel=1e-12)
    assert squeezed.static == pytest.approx(group.compliance.static.sum(), rel=1e-12)
    assert squeezed.modal == pytest.approx(group.compliance.modal.sum(), rel=1e-12)


def test_squeezing_is_held_less_than_pushing() -> None:
    """A force at the end of the chain bends all of it; two opposed ones strain the six springs between them."""
    right, _, squeezed = coordinates(chain(2))
    assert squeezed.static == pytest.approx(5.0, rel=1e-12)
    assert right.share > 0.9 > squeezed.share
    found = verdict(chain(2))
    assert "eigenmodes cannot hold" in found.sentence
    assert any("both contacts (right + left)" in r and "0.2 N/m" in r for r in found.messages)


def test_the_sentence_says_how_many_modes_are_enough() -> None:
    found = verdict(chain(12))
    needed = max(c.modes_for(0.99) or 0 for c in found.coordinates if c.kind == "translation")
    assert found.sentence.startswith(f"{needed} of 12 modes are enough")
    group = chain(3)
    lonely = dataclasses.replace(
        group, interfaces={k: dataclasses.replace(i, partner="") for k, i in group.interfaces.items()}
    )
    assert [c.kind for c in coordinates(lonely)] == ["translation", "translation"]


def test_bolts_that_face_another_body_are_not_squeezed() -> None:
    group = chain(3)
    bolts = {k: dataclasses.replace(i, role="bolt") for k, i in group.interfaces.items()}
    assert len(coordinates(dataclasses.replace(group, interfaces=bolts))) == 2


def test_modes_for() -> None:
    c = Coordinate("x u_n", "translation", "m/N", 2.0, 1.9, np.array([0.5, 0.9, 0.95]))
    assert (c.modes_for(0.4), c.modes_for(0.9), c.modes_for(0.99)) == (1, 2, None)
    assert c.share == 0.95 and c.residual == pytest.approx(0.1)
    rounded = dataclasses.replace(c, modal=(1 - 1e-9) * c.static, shares=np.array([0.5, 1 - 1e-9]))
    assert rounded.share == 1.0 and rounded.residual == 0.0


def test_kinds_and_units_of_a_modal_file() -> None:
    found = {c.label: c for c in coordinates(small.basis().groups[0, 0])}
    assert found["right u_n"].unit == "m/N" and found["right phi_t1"].unit == "rad/(N m)"
    assert found["shaker force"].unit == "m/N" and found["gas pressure"].unit == "m3/Pa"
    assert found["tip-probe u_x"].kind == "monitor"
    assert found["right + left squeezed"].kind == "squeeze"
    assert all(0 <= c.share <= 1 + 1e-9 for c in found.values())


def test_a_free_body_counts_its_elastic_part_only() -> None:
    for c in coordinates(small.basis(free=True).groups[0, 0]):
        assert (c.shares[:6] == 0).all()
        assert np.isfinite(c.shares).all()


def test_a_body_without_rows_has_nothing_to_check() -> None:
    group = small.basis().groups[0, 0]
    bare = dataclasses.replace(
        group,
        interfaces={},
        excitations={},
        monitors={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False),
    )
    assert verdict(bare).coordinates == ()
    assert "no compliance to check" in verdict(bare).sentence


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.99999, "99.999 %"),
        (0.9999999, "99.999 %"),
        (1.0, "100 %"),
        (0.5, "50.0 %"),
        (0.0007, "0.07 %"),
        (0.0, "0.0 %"),
    ],
)
def test_percent_never_rounds_up_to_all(share: float, text: str) -> None:
    assert percent(share) == text
