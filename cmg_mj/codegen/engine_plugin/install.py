"""Installs plugins: puts a library where `load` finds it, lists those that are there, and removes one."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import NamedTuple

from cmg_mj.codegen.engine_plugin import load
from cmg_mj.codegen.engine_plugin.build import check_platform
from cmg_mj.codegen.engine_plugin.files import library_name
from cmg_mj.codegen.engine_plugin.load import (
    FOLDER_MODE,
    MANIFEST,
    NAME,
    VARIABLE,
    InstalledPlugin,
    Refused,
    check_library,
    library_file,
    list_names,
    plugin_folder,
    read_manifest,
)
from cmg_mj.errors import InputError, nearest, shown
from cmg_mj.inputs.paths import expanded
from cmg_mj.results.files import whole_file, write_bytes

LONGEST_WAIT = 60.0  # for another install [s]
LONGEST_TRIAL = 20.0  # for a library to load, which takes milliseconds [s]
TRIAL = r"""
import runpy, sys
import mujoco
loader, *arguments = sys.argv[1:]
try:
    runpy.run_path(loader)["open_library"](*arguments)
except Exception as error:
    sys.exit(str(error))
print("\nloaded by MuJoCo", mujoco.__version__)
"""
"""Loads a library as `import mujoco` will, in a process of its own."""


class PluginStatus(NamedTuple):
    """An installed plugin, and whether `import mujoco` loads it.

    Attributes:
        name: Its name behind `cmg_mj.`.
        manifest: What its manifest says; None if that cannot be read.
        problem: Why it is not loaded; empty if it is.
    """

    name: str
    manifest: InstalledPlugin | None
    problem: str


def find_library(target: str) -> Path:
    """Find the library that a user means.

    Args:
        target: The library, the folder that `cmg-mj plugin` has written, or the name of a plugin in its default folder.

    Returns:
        The library.

    Raises:
        InputError: There is no library, or there are several.
    """
    if not target:
        raise InputError("--install '': name a library, a folder with one, or a plugin")
    path = expanded(target, "--install")
    is_name = re.fullmatch(NAME, target, re.ASCII) is not None
    default = Path("runs") / f"plugin-{target}"
    if is_name and not path.exists() and default.is_dir():
        path = default
    if not path.exists():
        nor_default = f", nor a folder {default}" if is_name else ""
        raise InputError(f"--install {shown(target)}: there is no such library or folder{nor_default}")
    if not path.is_dir():
        return path
    libraries = sorted(path.glob(library_name("*")))
    if not libraries:
        raise InputError(f"--install {path}: holds no library {library_name('NAME')}; `cmg-mj plugin` writes one")
    if len(libraries) > 1:
        names = ", ".join(library.name for library in libraries)
        raise InputError(f"--install {path}: holds several libraries, name one of them: {names}")
    return libraries[0]


def install(library: Path) -> InstalledPlugin:
    """Put a copy of a library into the folder, once it has been seen to load into MuJoCo; it replaces an earlier one.

    Args:
        library: The library.

    Returns:
        What was installed.

    Raises:
        InputError: The library does not load, or the folder is not the user's alone or cannot be written.
    """
    check_platform()
    name = _name_of(library)
    try:
        content = library.read_bytes()
    except OSError as error:
        raise InputError(f"--install {library}: cannot be read: {error.strerror}") from error
    sha256 = hashlib.sha256(content).hexdigest()
    with _own_folder() as folder:
        place = folder / library_file(name, sha256)
        with whole_file(place) as copy:
            write_bytes(copy, content)
            mujoco = _try(library, copy, name)
        plugin = InstalledPlugin(f"cmg_mj.{name}", place.name, sha256, mujoco, str(library.resolve()))
        write_bytes(folder / (name + MANIFEST), json.dumps(plugin._asdict(), indent=2).encode())
        _remove_libraries(folder, name, but=place)
    return plugin


def uninstall(name: str) -> str:
    """Remove a plugin that is installed, in whatever state it is.

    Args:
        name: Its name, with or without `cmg_mj.`.

    Returns:
        Its name under which MuJoCo knew it.

    Raises:
        InputError: No plugin has that name, or the folder is not the user's alone or cannot be written.
    """
    name = name.removeprefix("cmg_mj.")
    names = [status.name for status in list_plugins()[1]]
    if name not in names:
        raise InputError(f"--uninstall {shown(name)}: is not installed; {nearest(name, names, 'installed')}")
    with _own_folder() as folder:
        (folder / (name + MANIFEST)).unlink(missing_ok=True)
        _remove_libraries(folder, name)
    return f"cmg_mj.{name}"


def list_plugins() -> tuple[str, list[PluginStatus]]:
    """List the plugins that are installed, loaded or not.

    Returns:
        The folder, and its plugins.

    Raises:
        InputError: The folder is not the user's alone or cannot be read.
    """
    with _refusals():
        folder = plugin_folder()
        return folder, [_status(folder, name) for name in (list_names(folder) if folder else ())]


def is_called() -> bool:
    """Return whether `import mujoco` calls `load` here: the metadata of an older installation do not say so."""
    called = f"{load.__name__}:{load.load.__name__}"
    return any(point.value == called for point in entry_points(group="mujoco.plugins"))


def has_another(library: Path) -> bool:
    """Return whether another library is installed under this one's name, which this one's model will refuse."""
    with suppress(InputError, OSError):
        sha256 = hashlib.sha256(library.read_bytes()).hexdigest()
        manifests = [status.manifest for status in list_plugins()[1] if library_name(status.name) == library.name]
        return any(manifest is not None and manifest.sha256 != sha256 for manifest in manifests)
    return False


def _name_of(library: Path) -> str:
    match = re.fullmatch(library_name(f"({NAME})").replace(".", r"\."), library.name, re.ASCII)
    if match is None or not library.is_file():
        raise InputError(f"--install {library}: is no library {library_name('NAME')} of `cmg-mj plugin`")
    if re.fullmatch(r"run_\d+", match[1]):
        raise InputError(f"--install {library}: `cmg-mj run` needs {match[1]} itself; make it with another --name")
    return match[1]


@contextmanager
def _refusals() -> Iterator[None]:
    """Turn what `load` warns of into errors of the user's."""
    try:
        yield
    except Refused as error:
        raise InputError(f"plugin: {error}") from error
    except OSError as error:
        raise InputError(f"plugin: {error.filename or 'the folder of plugins'}: {error.strerror}") from error


@contextmanager
def _own_folder() -> Iterator[Path]:
    """Give the folder, made if need be, while no other process writes to it; remove what killed ones have left."""
    with _refusals():
        if not (name := plugin_folder()):
            raise InputError(f"plugin: {VARIABLE} is empty, so no plugin is loaded; unset it, or let it name a folder")
        folder = Path(name)
        folder.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        with suppress(FileExistsError):
            folder.mkdir(mode=FOLDER_MODE)
        list_names(name)  # refuses a folder of others, before anything is written
        for partial in folder.glob(".*.partial"):
            partial.unlink(missing_ok=True)
        yield folder


def _try(library: Path, copy: Path, name: str) -> str:
    """Load a library in a process of its own, and return MuJoCo's version there."""
    with tempfile.TemporaryDirectory() as elsewhere:  # MuJoCo writes a log where it is
        try:
            process = subprocess.run(
                [sys.executable, "-c", TRIAL, load.__file__, str(copy), name],
                cwd=elsewhere,
                env={**os.environ, VARIABLE: ""},
                capture_output=True,
                text=True,
                errors="replace",
                timeout=LONGEST_TRIAL,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(
                f"--install {library}: has not loaded within {LONGEST_TRIAL:g} s, where milliseconds are usual"
            ) from error
    if process.returncode < 0:
        raise InputError(f"--install {library}: crashed the process that loaded it (signal {-process.returncode})")
    if process.returncode:
        lines = process.stderr.replace(str(copy), str(library)).splitlines()
        raise InputError(f"--install {library}: does not load: {lines[-1] if lines else 'no message'}")
    match = re.search(r"^loaded by MuJoCo (\S+)$", process.stdout, re.MULTILINE)
    if match is None:
        raise InputError(f"--install {library}: ended the process that loaded it")
    return match[1]


def _remove_libraries(folder: Path, name: str, but: Path | None = None) -> None:
    """Remove the libraries of a plugin that no manifest names any more."""
    pattern = re.escape(name) + r"-[0-9a-f]{16}\.so"
    for path in folder.iterdir():
        if path != but and re.fullmatch(pattern, path.name):
            path.unlink(missing_ok=True)


def _status(folder: str, name: str) -> PluginStatus:
    plugin = None
    try:
        plugin = read_manifest(folder, name)
        check_library(folder, plugin, version("mujoco"))
    except (Refused, OSError) as error:
        return PluginStatus(name, plugin, " ".join(str(error).split()))
    return PluginStatus(name, plugin, "")
