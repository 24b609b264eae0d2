"""The names of a compiled model's plugins, which MuJoCo's Python package does not tell."""

from __future__ import annotations

import ctypes
from pathlib import Path

import mujoco


class _Plugin(ctypes.Structure):
    """The beginning of MuJoCo's mjpPlugin."""

    _fields_ = (("name", ctypes.c_char_p),)


def plugin_names(model: mujoco.MjModel) -> list[str]:
    """Name the plugin of each instance of a model, such as `mujoco.pid`."""
    if not model.nplugin:
        return []
    library = ctypes.CDLL(str(Path(mujoco.__file__).parent / f"libmujoco.so.{mujoco.__version__}"))
    library.mjp_getPluginAtSlot.restype = ctypes.POINTER(_Plugin)
    return [library.mjp_getPluginAtSlot(int(slot)).contents.name.decode() for slot in model.plugin]
