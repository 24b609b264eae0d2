"""Loads the installed plugins into MuJoCo: `import mujoco` calls `load`, an entry point of the group `mujoco.plugins`.

Every program that imports MuJoCo comes here, also one that knows nothing of this package. For that reason nothing but
the standard library is imported, and little of it while nothing is installed.
"""

from __future__ import annotations

import ctypes
import errno
import os
import re
import stat
import sys
import warnings
from typing import NamedTuple

VARIABLE = "CMG_MJ_PLUGINS"
"""Environment variable that names the folder; empty, nothing is loaded."""
MANIFEST = ".json"
FOLDER_MODE = 0o700
LONGEST_MANIFEST = 65536  # bytes
NAME = r"[A-Za-z][A-Za-z0-9_]{0,39}"
_WARNINGS_FROM = "<cmg_mj plugins>"  # as a file that has no lines: a warning is then one line


class Refused(Exception):
    """A plugin, or the folder with all of them, is not loaded; the message says why."""


class Missing(Refused):
    """A plugin's library is not there."""


class InstalledPlugin(NamedTuple):
    """A plugin as its manifest describes it.

    Attributes:
        plugin: Name under which MuJoCo knows it.
        library: File of the library, in the folder.
        sha256: Checksum of the library.
        mujoco: The one version of MuJoCo that it is loaded into.
        source: The library that it is a copy of.
    """

    plugin: str
    library: str
    sha256: str
    mujoco: str
    source: str


def load() -> None:
    """Load all plugins that are installed; warn of each that cannot be, in one line."""
    version = getattr(sys.modules.get("mujoco"), "__version__", None)
    if version is None or sys.platform != "linux":
        return
    problems: list[str] = []
    try:
        folder = plugin_folder()
        for name in list_names(folder) if folder else ():
            try:
                load_plugin(folder, name, version)
            except Exception as error:
                problems.append(f"cmg_mj.{name} is not loaded: {error}")
    except Exception as error:
        problems.append(f"no plugin is loaded: {error}")
    for problem in problems:  # at the end: a warning may be an exception
        warnings.warn_explicit(" ".join(problem.split()), RuntimeWarning, _WARNINGS_FROM, 1)


def plugin_folder() -> str:
    """Name the folder of the installed plugins: CMG_MJ_PLUGINS, or cmg_mj/plugins where XDG has a user's data.

    Returns:
        The folder, whether it is there or not; empty if CMG_MJ_PLUGINS is.

    Raises:
        Refused: Its path is not absolute.
    """
    folder = os.environ.get(VARIABLE)
    if folder is None:
        data = os.environ.get("XDG_DATA_HOME", "")
        if not os.path.isabs(data):  # as XDG has it
            data = os.path.expanduser("~/.local/share")
        folder = os.path.join(data, "cmg_mj", "plugins")
    if folder and not os.path.isabs(folder):
        raise Refused(f"{VARIABLE}={folder}: must be an absolute path, or empty for no plugins")
    return folder


def list_names(folder: str) -> list[str]:
    """Name the plugins in a folder, by the files of their manifests; none if there is no such folder.

    Raises:
        Refused: Others than the user can write to the folder, or have made it.
        OSError: It cannot be read.
    """
    try:
        status = os.lstat(folder)
    except FileNotFoundError:
        return []
    mode = stat.S_IMODE(status.st_mode)
    if not stat.S_ISDIR(status.st_mode):
        raise Refused(f"{folder} is no folder, but a {'link' if stat.S_ISLNK(status.st_mode) else 'file'}")
    if status.st_uid != os.geteuid():
        raise Refused(f"{folder} belongs to another user (number {status.st_uid})")
    if mode & ~FOLDER_MODE & 0o777:
        raise Refused(f"{folder} is open to others: its mode is {mode:04o} and must be {FOLDER_MODE:04o}")
    files = sorted(os.listdir(folder))
    return [file.removesuffix(MANIFEST) for file in files if file.endswith(MANIFEST) and file[0] != "."]


def read_manifest(folder: str, name: str) -> InstalledPlugin:
    """Read what is said of a plugin.

    Args:
        folder: The folder of the installed plugins.
        name: The plugin's name behind `cmg_mj.`.

    Raises:
        Refused: It is not as this package writes it.
        OSError: It cannot be read.
    """
    import json

    file = name + MANIFEST
    if not re.fullmatch(NAME, name, re.ASCII):
        raise Refused(f"{file!a} has not been written by this package")
    damaged = Refused(f"its manifest {file} has not been written by this package, or is damaged")
    try:
        plugin = InstalledPlugin(**json.loads(_read(folder, file, LONGEST_MANIFEST)))
    except (ValueError, TypeError, RecursionError):
        raise damaged from None
    if not (
        all(isinstance(value, str) for value in plugin)
        and plugin.plugin == f"cmg_mj.{name}"
        and re.fullmatch(r"[0-9a-f]{64}", plugin.sha256, re.ASCII)
        and plugin.library == library_file(name, plugin.sha256)
    ):
        raise damaged
    return plugin


def library_file(name: str, sha256: str) -> str:
    """Name the copy of a library: a new one never takes the place of one in use."""
    return f"{name}-{sha256[:16]}.so"


def check_library(folder: str, plugin: InstalledPlugin, mujoco: str) -> str:
    """Check that a library is the one that was installed, and made for this MuJoCo.

    Args:
        folder: The folder of the installed plugins.
        plugin: The plugin.
        mujoco: The version of MuJoCo that would load it.

    Returns:
        Path of the library.

    Raises:
        Refused: It is not.
        Missing: It is not there.
        OSError: It cannot be read.
    """
    import hashlib

    if plugin.mujoco != mujoco:
        raise Refused(f"it is for MuJoCo {plugin.mujoco}, and this is {mujoco}")
    try:
        content = _read(folder, plugin.library)
    except FileNotFoundError:
        raise Missing(f"its library {plugin.library} is missing") from None
    if hashlib.sha256(content).hexdigest() != plugin.sha256:
        raise Refused(f"its library {plugin.library} has been changed (SHA-256)")
    return os.path.join(folder, plugin.library)


def load_plugin(folder: str, name: str, mujoco: str) -> None:
    """Load a plugin that is installed; nothing happens if it is no longer.

    Args:
        folder: The folder of the installed plugins.
        name: The plugin's name behind `cmg_mj.`.
        mujoco: The version of MuJoCo.

    Raises:
        Refused: It is not loaded.
        OSError: A file cannot be read, or the library cannot be loaded.
    """
    plugin = None
    while True:  # until nobody has installed another library meanwhile
        previous = plugin
        try:
            plugin = read_manifest(folder, name)
        except FileNotFoundError:
            return
        try:
            open_library(check_library(folder, plugin, mujoco), name)
        except Missing:
            if plugin == previous:
                raise
        else:
            return


def open_library(library: str, name: str) -> None:
    """Open a plugin's library, which then registers the plugin with MuJoCo.

    Raises:
        Refused: It has not registered it.
        OSError: It cannot be loaded.
    """
    handle = ctypes.CDLL(library)
    try:
        get_plugin = handle.mjp_getPlugin  # of MuJoCo's library, with which this one is linked
    except AttributeError:
        raise Refused("its library is no plugin of MuJoCo") from None
    get_plugin.argtypes, get_plugin.restype = (ctypes.c_char_p, ctypes.c_void_p), ctypes.c_void_p
    if not get_plugin(f"cmg_mj.{name}".encode(), None):
        raise Refused(f"its library has no plugin cmg_mj.{name}, or none for this MuJoCo")


def _read(folder: str, file: str, most: int = -1) -> bytes:
    """Read an ordinary file of the user's; refuse a link or a pipe."""
    refusal = f"{file} is no ordinary file of this user's"
    try:
        descriptor = os.open(os.path.join(folder, file), os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise Refused(refusal) from None
        raise
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode) or status.st_uid != os.geteuid():
        os.close(descriptor)
        raise Refused(refusal)
    with open(descriptor, "rb") as content:
        return content.read(most)
