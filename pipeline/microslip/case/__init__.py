"""case.toml: an assembly of bodies and what is asked of it, and how it is run."""

from .run import CaseResult as CaseResult
from .run import run_case as run_case
from .settings import CaseSettings as CaseSettings
from .settings import load_case as load_case
