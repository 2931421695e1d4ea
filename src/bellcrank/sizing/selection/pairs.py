"""Which motors go with which gears: combinations as index arrays, so that criteria judge many of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor

LINEAR_GEARS = ("screw", "rack")
