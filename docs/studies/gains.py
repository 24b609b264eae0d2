"""Table 2's gains, scaled gains and an LQR on the papers' rig and on rigs that changed: one row a rig and gains.

python docs/studies/gains.py (two minutes). Each row: the gains, the loop with the true rate on the reduced model, the
linear closed loop with the observer in it, and how many of some worlds stood after the push of `push_recovery`.

A changed rig is the bundled model with more mass on its frame, a longer frame, or slower flywheels. The push is as
large for each rig as its own inertia and gravity ask for: it takes the tilt to the same share of what the rig bears.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from tabulate import tabulate

import cmg_mj
from cmg_mj.inputs.bundled import folder
from cmg_mj.scenario.stability_check import closed_loop
