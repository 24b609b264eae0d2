"""An export: traced, printed, compared, written."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import numpy as np

from cmg_mj.controller import Controller
from cmg_mj.export.c_code import Precision
from cmg_mj.export.constants import constants_of
from cmg_mj.export.texts import Texts
from cmg_mj.export.trace import trace
from cmg_mj.observers.registry import OBSERVERS
from cmg_mj.run_folder import RunFolder
from cmg_mj.run_folder.folder import claimed, write_text
from cmg_mj.sensors import Accelerometer, Encoder, Ideal, Sensors


def name_of(observer: object) -> str:
    cls = type(observer)
    path = f"{cls.__module__}:{cls.__qualname__}"
    for name, known in OBSERVERS.items():
        if path == known:
            return name
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()


def signals(controller: Controller, ticks: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    n = len(controller.directions)
    dt = controller.law.dt
    t = dt * np.arange(ticks)
    tilt = 0.1 * np.sin(9.0 * t) + rng.normal(0.0, 2e-3, ticks)
    alpha = -8.1 * np.sin(9.0 * t)
    tangential, radial = -9.81 * np.sin(tilt), 9.81 * np.cos(tilt)
    columns = []
    for r in (controller.tilt.r_inner, controller.tilt.r_outer):
        columns += [tangential + r * alpha + rng.normal(0, 0.04, ticks), radial + rng.normal(0, 0.04, ticks)]
    gimbal = 0.3 * np.sin(3.0 * t)
    for i in range(n):
        columns.append(controller.gimbal_zero[i] + controller.directions[i] * gimbal + rng.normal(0, 1e-3, ticks))
    return np.array(columns).T


def in_python(controller: Controller, inputs: np.ndarray) -> np.ndarray:
    rate = 1.0 / controller.law.dt
    sensors = Sensors(Accelerometer(rate, 0.0, range_g=1e9, counts_per_g=0.0), Encoder(rate, counts_per_revolution=0.0))
    fresh = Controller(
        controller.observer,
        controller.law,
        controller.tilt,
        sensors,
        directions=controller.directions,
        gimbal_zero=controller.gimbal_zero,
        timestep=controller.timestep,
        angles=controller.angles,
    )
    rows = []
    for k, row in enumerate(inputs.tolist()):
        fresh.update(k * fresh.period, Ideal(tuple(row[:4]), row[4:], 0.0, 0.0))
        assert fresh.tick is not None
        rows.append([*fresh.tick.estimates[0], fresh.tick.u])
    return np.array(rows)


def export(controller: Controller, out: Path | RunFolder, precision: Precision) -> list[Path]:
    constants = constants_of(controller)
    observer = copy.deepcopy(controller.observer)
    spare = copy.copy(controller)
    spare.observer = observer
    traced = trace(spare, constants)
    name = name_of(controller.observer)
    texts = Texts(name, controller, traced, constants, precision)
    inputs = signals(controller, 400, 0)
    if precision == "single":
        inputs = inputs.astype(np.float32).astype(float)
    expected = in_python(controller, inputs)
    files = {
        f"{name}.h": texts.header(),
        f"{name}.c": texts.source(),
        f"{name}_example.c": texts.example(),
        f"{name}_test_vector.h": texts.vector(inputs.tolist(), expected.tolist()),
    }
    with claimed(out) as folder:
        place = folder.write({file: lambda path, text=text: write_text(path, text) for file, text in files.items()})
    return [place / file for file in files]
