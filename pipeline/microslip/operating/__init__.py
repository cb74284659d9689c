"""What a body does in a steady vibration: where its points go, how it is stressed, how long it lasts.

Everything starts from harmonics of the coordinates of a modal file, whoever found them. `motion`: displacement of any
point, monitors, gauges. `stress`: stresses over the cycle. `fatigue`: margins from their amplitude and mean.
"""

from .fatigue import MaterialLimits as MaterialLimits
from .motion import motion_of as motion_of
