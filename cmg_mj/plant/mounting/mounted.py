"""A robot with a pair on it, and its file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import mujoco

from cmg_mj.errors import InputError
from cmg_mj.inputs.includes import check_files
from cmg_mj.plant.mjcf import check_rig
from cmg_mj.results.files import whole_file


@dataclass(frozen=True)
class MountedRobot:
    """A robot with a pair on it.

    Attributes:
        spec: The model, which can be edited further.
        path: What to call the robot it was made from.
        held: Joints that an equality constraint holds where they stand.
        notes: What was changed in the robot besides, in clauses.
    """

    spec: mujoco.MjSpec
    path: Path
    held: tuple[str, ...]
    notes: tuple[str, ...]

    def save(self, path: str | Path) -> Path:
        """Write it as MJCF, which plain MuJoCo loads and `plant.model` takes; whole or not at all.

        Args:
            path: The file. Meshes and textures are not copied: it names them from where it lies.

        Returns:
            The file.

        Raises:
            InputError: It cannot be written, is no .xml, or would lie in place of the robot itself or of what it names.
        """
        target = Path(path).expanduser()
        check_target(target, self.path)
        spec = self.spec.copy()
        for field in ("meshdir", "texturedir"):
            setattr(spec, field, _seen_from(target.resolve().parent, spec.modelfiledir, getattr(spec, field)))
        try:
            with whole_file(target, ".xml") as temporary:
                temporary.write_text(spec.to_xml(), encoding="utf-8")
                check_rig(temporary, target)
        except OSError as error:
            raise InputError(f"-o {path}: cannot be written: {error.strerror}") from error
        return target


def check_target(target: Path, robot: Path) -> None:
    """See that a mounted robot may be written somewhere.

    Args:
        target: The file that it is to be.
        robot: What it is made from, if that is a file.

    Raises:
        InputError: It is no .xml file, has no folder, or it or the scenario beside it would lie in the place of the
            robot's file or of one that this names.
    """
    if target.suffix != ".xml":
        raise InputError(
            f"-o {target}: must be a file that ends in .xml, such as balanced.xml; a .toml comes beside it"
        )
    if not target.parent.is_dir():
        raise InputError(f"-o {target}: cannot be written: there is no folder {target.parent}")
    own = check_files(robot) if robot.is_file() else []
    for path in (target, target.with_suffix(".toml")):
        if path.is_dir():
            raise InputError(f"-o {target}: {path} is a folder")
        if path.exists() and any(file.exists() and path.samefile(file) for file in own):
            raise InputError(f"-o {target}: {path} is the robot's own file, or one that it names; give another name")


@contextmanager
def with_scenario(target: Path) -> Iterator[Path]:
    """Write a model and the scenario beside it, both whole or neither.

    Args:
        target: The model's file.

    Yields:
        A temporary name for the model; both files are renamed at the end, or removed if something failed.

    Raises:
        InputError: What the writing raises, the files called by their names; or they cannot be renamed.
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


def _seen_from(folder: Path, model_folder: str, assets: str) -> str:
    """A folder of assets, which the robot's file names from where it lies, from another folder."""
    return os.path.relpath(Path(model_folder or ".").resolve() / assets, folder)
