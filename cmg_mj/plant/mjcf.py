"""MJCF files, parsed, compiled and written; with a line that says what MuJoCo refuses."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import model_files

OWN = "cmg_mj."
"""Prefix of the names of this package's plugins."""
_REFUSALS = ValueError, RuntimeError, MemoryError, mujoco.FatalError


def _one_line(error: Exception) -> str:
    """MuJoCo's message without what tells a user nothing."""
    text = " ".join(str(error).split()).removeprefix("Error: ")
    return re.sub(r" The (static|visual) .* remain so\.", "", text)


def parse(path: Path) -> mujoco.MjSpec:
    """Read a model file, without this package's plugins.

    Raises:
        InputError: It is no MJCF.
    """
    return parse_without_plugins(path)[0]


def parse_without_plugins(path: Path) -> tuple[mujoco.MjSpec, list[str]]:
    """Parse a model without this package's plugins, their instances and their sensors.

    MuJoCo reads no file with a plugin whose library is not loaded. What the file includes is read as it is. Runs and
    analyses bring the controller themselves.

    Args:
        path: The model's file.

    Returns:
        The parsed model, and the names of the plugins that were in it.

    Raises:
        InputError: It is no MJCF.
    """
    model_files(path)
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):  # MuJoCo, which reads more than this parser, says what is wrong
        root = ElementTree.Element("mujoco")
    own = [plugin for plugin in root.findall("extension/plugin") if plugin.get("plugin", "").startswith(OWN)]
    instances = {instance.get("name") for plugin in own for instance in plugin.findall("instance")}
    for parent in list(root.iter()) if own else ():
        for plugin in parent.findall("plugin"):
            if plugin in own or plugin.get("instance") in instances:
                parent.remove(plugin)
    try:
        with mujoco.MjVfs() as files:
            if own:  # MuJoCo takes this before the file of that name
                files[str(path)] = ElementTree.tostring(root, "unicode").encode()
            spec = mujoco.MjSpec.from_file(str(path), vfs=files)
    except _REFUSALS as error:
        raise InputError(f"{path}: not a model MuJoCo can read: {_one_line(error)}") from error
    return spec, [plugin.get("plugin", "") for plugin in own]


def compile_model(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a parsed model.

    Raises:
        InputError: MuJoCo's compiler refuses it, or it has a plugin of this package's.
    """
    if any(plugin.plugin_name.startswith(OWN) for plugin in spec.plugins):
        raise InputError(f"{path}: a file that it includes has a plugin of cmg_mj's; take the plugin out of that file")
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            model = spec.compile()
    except _REFUSALS as error:
        raise InputError(f"{path}: does not compile: {_one_line(error)}") from error
    for warning in warned:
        if "singular" in str(warning.message):
            raise InputError(f"{path}: does not compile: its masses and inertias are of too different sizes")
    return model


def as_mjcf(spec: mujoco.MjSpec, path: Path) -> str:
    """Write a model as MJCF.

    Raises:
        InputError: MuJoCo cannot write it, or does not find its meshes and textures.
    """
    try:
        return spec.to_xml()
    except _REFUSALS as error:
        raise InputError(f"{path}: MuJoCo cannot write it: {_one_line(error)}") from error


@contextmanager
def quiet() -> Iterator[None]:
    """Switch off warnings of MuJoCo and numpy, and MUJOCO_LOG.TXT in the current folder. Callers report faults."""
    before, config = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    config.set()
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        before.set()


@contextmanager
def set_control_callback(callback: object | None) -> Iterator[None]:
    """Have MuJoCo call this control callback (None: none), and the one before it again afterwards."""
    before = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(callback)
    try:
        yield
    finally:
        mujoco.set_mjcb_control(before)


def data_at_keyframe(model: mujoco.MjModel, key: int) -> mujoco.MjData:
    """Return fresh data at a keyframe, after a forward pass."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Return fresh data with given joint positions, after a forward pass."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data
