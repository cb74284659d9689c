"""Newton's method (`newton`), following R(x, lambda) = 0 through folds, branch points and kinks (`curve`), peaks of an
output on that curve and where they are lowest over a further parameter (`extremum`).

Knows no mechanics: lambda may be a frequency, a normal force, a level of excitation.
"""

from .curve import Branch as Branch
from .curve import Lost as Lost
from .curve import Point as Point
from .curve import Segment as Segment
from .curve import Settings as Settings
from .curve import State as State
from .curve import advance as advance
from .curve import branch_off as branch_off
from .curve import follow as follow
from .curve import root as root
from .curve import start as start
from .curve import switched as switched
from .curve import trace as trace
from .extremum import NO_OPTIMUM as NO_OPTIMUM
from .extremum import SEARCH as SEARCH
from .extremum import Lowest as Lowest
from .extremum import Peak as Peak
from .extremum import lowest as lowest
from .extremum import peak as peak
from .extremum import placed as placed
from .extremum import rated as rated
from .extremum import with_peaks as with_peaks
from .newton import CONVERGED as CONVERGED
from .newton import Equations as Equations
from .newton import NewtonSettings as NewtonSettings
from .newton import Scaled as Scaled
from .newton import Solution as Solution
from .newton import newton as newton
