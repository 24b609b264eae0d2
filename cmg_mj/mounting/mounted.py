"""A robot with a pair on it, and its file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import mujoco

from cmg_mj.errors import InputError
from cmg_mj.mjcf import check_rig
from cmg_mj.trajectory import whole_file


@dataclass(frozen=True)
class Mounted:
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
            InputError: It cannot be written, or would lie in place of the robot itself.
        """
        target = Path(path).expanduser()
        if target.exists() and self.path.exists() and target.samefile(self.path):
            raise InputError(f"-o {path}: is the robot's own file; give another name")
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


def _seen_from(folder: Path, model_folder: str, assets: str) -> str:
    """A folder of assets, which the robot's file names from where it lies, from another folder."""
    return os.path.relpath(Path(model_folder or ".").resolve() / assets, folder)
