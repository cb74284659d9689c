"""Systems of bodies: small ones by hand (`lumped`), and bodies that touch (`assembly`, which needs jax)."""

from .lumped import Body as Body
from .lumped import Contact as Contact
from .lumped import Damper as Damper
from .lumped import Force as Force
from .lumped import Link as Link
from .lumped import Monitor as Monitor
from .lumped import Spring as Spring
from .lumped import System as System
from .settings import load_system as load_system
from .settings import system_basis as system_basis
