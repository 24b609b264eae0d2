"""A robot with a pair mounted on it, and its file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import mujoco

from cmg_mj.core.errors import InputError
from cmg_mj.inputs.files import expanded, model_files
from cmg_mj.plant.build import check_rig
from cmg_mj.plant.mjcf import as_mjcf
from cmg_mj.results.folder import is_signed, signed, whole_file


@dataclass(frozen=True)
class MountedRobot:
    """A robot with a pair on it.

    Attributes:
        spec: The model, which can be edited further.
        path: File of the robot, or a name for messages.
        held: Joints that an equality constraint holds where they stand.
        notes: Other changes to the robot, in clauses.
    """

    spec: mujoco.MjSpec
    path: Path
    held: tuple[str, ...]
    notes: tuple[str, ...]

    def save(self, path: str | Path) -> Path:
        """Write the robot as MJCF, which plain MuJoCo loads and `plant.model` takes; whole or not at all.

        A file that a mount has written is replaced. No other file ever is.

        Args:
            path: The file, in any folder. It refers to meshes and textures by relative paths; they are not copied.

        Returns:
            The file.

        Raises:
            InputError: The file cannot be written, is no .xml, or would replace the robot, a file that it names, or
                one that no mount wrote.
        """
        target = expanded(path, "-o")
        check_target(target, self.path)
        spec = self.spec.copy()
        folder = Path(os.path.abspath(target.parent))
        for field in ("meshdir", "texturedir"):
            setattr(spec, field, _relative_assets(folder, spec.modelfiledir, getattr(spec, field)))
        spec.modelfiledir = f"{folder}{os.sep}"  # MuJoCo opens the meshes to write them
        try:
            if os.path.lexists(target):
                require_signed(target)
            with whole_file(target, ".xml") as temporary:
                temporary.write_bytes(signed(as_mjcf(spec, self.path), ".xml"))
                check_rig(temporary, target)
        except OSError as error:
            raise InputError(f"-o {path}: cannot be written: {error.strerror}") from error
        return target


def check_target(target: Path, robot: Path) -> None:
    """Check that a mounted robot may be written to a file.

    Args:
        target: The file to write.
        robot: The robot's own file, if there is one.

    Raises:
        InputError: The target is no .xml file, has no folder, or would replace a file of the robot's; or the scenario
            beside it would.
    """
    if target.suffix != ".xml":
        raise InputError(
            f"-o {target}: must be a file that ends in .xml, such as balanced.xml; a .toml comes beside it"
        )
    if not target.parent.is_dir():
        raise InputError(f"-o {target}: cannot be written: there is no folder {target.parent}")
    originals = model_files(robot) if robot.is_file() else []
    for path in (target, target.with_suffix(".toml")):
        if path.is_dir():
            raise InputError(f"-o {target}: {path} is a folder")
        if path.exists() and any(file.exists() and path.samefile(file) for file in originals):
            raise InputError(f"-o {target}: {path} is the robot's own file, or one that it names; give another name")


def check_replaceable(target: Path, *, overwrite: bool) -> None:
    """Refuse to replace what no mount has written, or anything without being asked to.

    Args:
        target: The model's file.
        overwrite: Whether it and the scenario beside it may be replaced, if a mount has written them.

    Raises:
        InputError: One of the files is there and may not be replaced.
        OSError: It cannot be read.
    """
    for file in (target, target.with_suffix(".toml")):
        if os.path.lexists(file):
            require_signed(file)
            if not overwrite:
                raise InputError(f"-o {target}: {file} exists; give another name, or --overwrite")


def require_signed(file: Path) -> None:
    """Refuse to replace a file that no mount has written."""
    if not is_signed(file):
        raise InputError(f"-o = {file}: is not a file of cmg-mj mount, and would be lost; give another name")


@contextmanager
def with_scenario(target: Path) -> Iterator[Path]:
    """Write a model and the scenario beside it, both whole or neither.

    Args:
        target: The model's file.

    Yields:
        A temporary name for the model; both files are renamed at the end, or removed if something failed.

    Raises:
        InputError: As raised while writing, with the final file names; or the files cannot be renamed.
    """
    temporary = target.with_name(f".{target.stem}.{os.getpid()}.partial.xml")
    files = [(temporary.with_suffix(suffix), target.with_suffix(suffix)) for suffix in (".xml", ".toml")]
    try:
        yield temporary
        for written, file in files:
            written.replace(file)
    except InputError as error:
        raise InputError(str(error).replace(temporary.stem, target.stem)) from error
    except OSError as error:
        raise InputError(f"-o {target}: cannot be written: {error.strerror}") from error
    finally:
        for written, _ in files:
            with suppress(OSError):
                written.unlink()


def _relative_assets(folder: Path, model_folder: str, assets: str) -> str:
    """Return the path of a robot's folder of assets, relative to another folder.

    It is absolute where a symbolic link makes the relative path depend on how the model is opened.
    """
    path = os.path.abspath(os.path.join(model_folder, assets))
    relative = os.path.relpath(path, folder)
    return relative if relative == os.path.relpath(os.path.realpath(path), os.path.realpath(folder)) else path
