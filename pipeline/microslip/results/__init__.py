"""Results that survive interruption: every finished point is kept at once, the file people use is complete or absent.

`journal`: points as they are found, appended to a file of complete records. `files`: ``response.h5``, made from it.
`table`: ``response.csv`` of the same points. `names`: numbers in the names of series and columns.
"""

from .files import Body as Body
from .files import Response as Response
from .files import read_response as read_response
from .files import response_of as response_of
from .files import write_response as write_response
from .journal import Journal as Journal
from .journal import open_journal as open_journal
from .journal import read_journal as read_journal
from .series import Series as Series
from .table import response_table as response_table
