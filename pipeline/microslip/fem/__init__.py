"""Weak forms -> K, M, K_sigma, K_spin, G_gyro and loads, vectorised over elements.

scikit-fem supplies the shape functions and the quadrature; the contraction over all elements is one matrix
product per batch. The plain scikit-fem forms are the oracle in the tests.
"""

from .discretise import Block, Discretisation, FacetBlock, discretise, facet_block
from .loads import body_force, centrifugal, pressure, thermal
from .operators import (
    displacement_gradient,
    green_strain,
    internal_force,
    isotropic,
    mass,
    orthotropic,
    spin_projector,
    stiffness,
    stress_stiffness,
    tangent,
)

__all__ = [
    "Block",
    "Discretisation",
    "FacetBlock",
    "body_force",
    "centrifugal",
    "discretise",
    "displacement_gradient",
    "facet_block",
    "green_strain",
    "internal_force",
    "isotropic",
    "mass",
    "orthotropic",
    "pressure",
    "spin_projector",
    "stiffness",
    "stress_stiffness",
    "tangent",
    "thermal",
]
