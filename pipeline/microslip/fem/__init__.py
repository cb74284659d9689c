"""Weak forms -> K, M, K_sigma, K_spin, G_gyro and loads, vectorised over elements.

scikit-fem supplies the shape functions and the quadrature; the contraction over all elements is one matrix
product per batch. The plain scikit-fem forms are the oracle in the tests.
"""

from ..elasticity import isotropic as isotropic
from ..elasticity import orthotropic as orthotropic
from .discretise import discretise as discretise
from .loads import centrifugal as centrifugal
from .loads import pressure as pressure
from .operators import displacement_gradient as displacement_gradient
from .operators import green_strain as green_strain
from .operators import internal_force as internal_force
from .operators import mass as mass
from .operators import spin_projector as spin_projector
from .operators import stiffness as stiffness
from .operators import stress_stiffness as stress_stiffness
from .operators import tangent as tangent
