"""Forced vibration with friction in the frequency domain (Sextro, chapter 5).

`jenkins`: one harmonic, linear normal contact and one Jenkins element a contact, in closed form.
"""

from .jenkins import FrequencyResponse as FrequencyResponse
from .jenkins import JenkinsContact as JenkinsContact
from .jenkins import Residual as Residual
from .jenkins import frequency_response as frequency_response
from .jenkins import jenkins_harmonic as jenkins_harmonic
from .jenkins import peaks as peaks
from .jenkins import refined_peaks as refined_peaks
from .jenkins import response_table as response_table
from .jenkins import stuck_frequencies as stuck_frequencies
