"""The modal file: write, read, check. The layout is documented in ``docs/modal_file.md``."""

from .checks import Check as Check
from .checks import check_basis as check_basis
from .files import CONVENTIONS as CONVENTIONS
from .files import FORMAT as FORMAT
from .files import FORMAT_VERSION as FORMAT_VERSION
from .files import read_basis as read_basis
from .files import sample as sample
from .files import write_basis as write_basis
