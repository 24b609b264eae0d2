"""Fingerprints of a study and of its chunks; each chunk carries its own in its file's metadata."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import tomli_w

from cmg_mj.errors import InputError, shown
from cmg_mj.inputs.files import find, model_files
from cmg_mj.simulation.experiment import prepare
from cmg_mj.studies.sweeps.axes import FieldValue
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.studies.sweeps.varied_tracks import varied_tracks

if TYPE_CHECKING:
    import pyarrow as pa

KEY = b"cmg_mj.chunk"
FREE = "order"
"""Field of [sweep] that no trial depends on: another value is no other study."""
StudyFields: TypeAlias = "dict[str, dict[str, FieldValue]]"
"""A study file's sections."""


@dataclass(frozen=True)
class ChunkFingerprint:
    """Hashes and versions of everything that a chunk's figures depend on.

    Attributes:
        study: Hash of the study.
        model: Hash of its models' files.
        chunk: The chunk's number, such as `2 of 8`.
        versions: Name -> version with which the chunk was computed.
        rows: Number of its trials.
        content: Hash of their values.
    """

    study: str
    model: str
    chunk: str
    versions: Mapping[str, str]
    rows: int = 0
    content: str = ""

    def as_metadata(self) -> dict[bytes, bytes]:
        """Make metadata of a file."""
        return {KEY: json.dumps(asdict(self)).encode()}


def fingerprint_in(metadata: Mapping[bytes, bytes] | None) -> ChunkFingerprint | None:
    """Read the fingerprint of a file; None if it has none."""
    try:
        fingerprint = ChunkFingerprint(**json.loads((metadata or {})[KEY]))
    except (LookupError, ValueError, TypeError, RecursionError):
        return None
    return fingerprint if isinstance(fingerprint.versions, dict) else None


def hash_of_table(table: pa.Table) -> str:
    """Hash the values of a table, which its file's compression and layout leave the same."""
    digest = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns, strict=True):
        digest.update(f"{name} {column.type} {column.to_pylist()}".encode(errors="surrogatepass"))
    return digest.hexdigest()


def damage(table: pa.Table, there: ChunkFingerprint) -> str | None:
    """Say how a chunk's trials differ from those that were kept; None if they do not."""
    if len(table) != there.rows:
        return f"holds {len(table)} trials of {there.rows}"
    return None if hash_of_table(table) == there.content else "holds other values than were computed"


def not_ours(there: ChunkFingerprint | None, ours: ChunkFingerprint) -> str | None:
    """Say why a chunk is not the expected one; None if it is, with whatever versions."""
    if there is None or there.study != ours.study:
        return "holds no trials of this study"
    if there.model != ours.model:
        return "was computed with a model file or a track that has changed since"
    return None if there.chunk == ours.chunk else f"is chunk {there.chunk}, in the place of {ours.chunk}"


def other_version(there: Mapping[str, FieldValue], ours: Mapping[str, str]) -> str | None:
    """Name the first version that differs, with both values; None if none does."""
    for name, version in ours.items():
        if there.get(name) != version:
            return f"{name} {there.get(name, 'of no known version')} there, {version} here"
    return None


def hash_of_study(fields: StudyFields) -> str:
    """Hash a resolved study, without its versions and what else no trial depends on."""
    return hashlib.sha256(json.dumps(without_asides(as_read(fields)), sort_keys=True).encode()).hexdigest()


def hash_of_models(study: SweepStudy) -> str:
    """Hash the files of the study's model, or of those that it varies, with all that they include, and its tracks.

    Raises:
        InputError: A file cannot be read.
    """
    varied = [str(value) for axis in study.axes if "plant.model" in axis.fields for value in axis.values]
    digest = hashlib.sha256()
    for model in varied or [study.scenario.plant.model]:
        for path in model_files(find("models", model, ".xml", "plant.model =")):
            try:
                content = path.read_bytes()
            except OSError as error:
                raise InputError(
                    f"plant.model = {model!r}: {path} cannot be read: {error.strerror or error}"
                ) from error
            digest.update(f"{path.name} {len(content)}\n".encode() + content)
    tracks = [(f"pivot.{i}.file", pivot.file) for i, pivot in enumerate(study.scenario.pivot) if pivot.file is not None]
    for field, file in [*tracks, *(track for axis in study.axes for track in varied_tracks(axis))]:
        try:
            content = Path(file).read_bytes()
        except OSError as error:
            raise InputError(f"{field} = {file!r}: cannot be read: {error.strerror or error}") from error
        digest.update(f"track {field} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def as_read(fields: StudyFields) -> StudyFields:
    """Make fields into what comes back from a study file."""
    return tomllib.loads(tomli_w.dumps(fields))


def without_asides(fields: StudyFields) -> StudyFields:
    """Discard a study's fields that may change without its being another."""
    asides = {"sweep": FREE, "scenario": "versions"}
    return {
        name: {key: value for key, value in part.items() if key != asides[name]} if name in asides else part
        for name, part in fields.items()
    }


def first_difference(there: FieldValue | None, here: FieldValue | None, at: str = "") -> str | None:
    """Find the first field in which two studies differ, with both values, shortened; None if they are equal."""
    if there == here:
        return None
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        pairs = [(f"{at}.{key}".strip("."), there.get(key), here.get(key)) for key in sorted({*there, *here})]
        return next(text for name, a, b in pairs if (text := first_difference(a, b, name)))
    if isinstance(there, list) and isinstance(here, list) and shown(there) == shown(here):
        if len(there) != len(here):
            return f"{at} has {len(there)} values there, {len(here)} here"
        pairs = [(f"{at}.{i}", a, b) for i, (a, b) in enumerate(zip(there, here, strict=True))]
        return next(text for name, a, b in pairs if (text := first_difference(a, b, name)))
    there_text, here_text = ("nothing" if value is None else shown(value) for value in (there, here))
    return f"{at} = {there_text} there, {here_text} here"


def resolved(study: SweepStudy) -> StudyFields:
    """Write every default of a study's scenario out: the study reruns from that."""
    fields = prepare(study.scenario).resolved()
    varied = [field for axis in study.axes for field in axis.fields]
    for field in varied:
        section, _, name = field.rpartition(".")
        if field == "plant.timestep_s" or section != "plant":
            continue
        fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    weights = study.scenario.controller.lqr
    if weights is not None:  # solved for anew on every plant
        fields["controller"]["lqr"] = weights.model_dump(mode="json")
    if weights is not None or any(f"{field}.".startswith("controller.lqr.") for field in varied):
        fields["controller"].pop("gains", None)
    if "controller.kind" in varied:  # each law has parameters of its own
        fields["controller"] = study.scenario.as_fields()["controller"]
    return study.as_fields(fields)
