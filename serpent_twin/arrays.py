"""The type of an array of floats, whose shape and unit the docstrings say."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
