"""Finds a class by its name or dotted path, checks its parameters, and makes an object of it."""

from __future__ import annotations

import importlib
import inspect
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from cmg_mj.core.errors import InputError, TomlValue, nearest, raised
from cmg_mj.inputs.messages import complaints, fields_of


@dataclass(frozen=True)
class UserClassKind:
    """A kind of class that users may write, and what messages call it.

    Attributes:
        what: `observer` or `law`.
        section: The scenario's section whose `kind` names one and whose other fields are its parameters.
        known: Name a user types -> dotted path of the class.
        always_given: Parameters that the bench gives to a class that takes them, or any.
        given_if_taken: Parameters that the bench gives to a class that takes them by name.
        methods: What it must have: name -> its parameters, in words.
    """

    what: str
    section: str
    known: Mapping[str, str]
    always_given: tuple[str, ...]
    given_if_taken: tuple[str, ...]
    methods: Mapping[str, str]

    @property
    def bench_parameters(self) -> tuple[str, ...]:
        """The parameters that are not the user's choice."""
        return (*self.always_given, *self.given_if_taken)

    def find(self, kind: str) -> type:
        """Find a class.

        Args:
            kind: A name of `known`, or `package.module:Class`.

        Returns:
            The class.

        Raises:
            InputError: There is no such class, or its module cannot be imported.
        """
        setting = f"{self.section}.kind = {kind!r}"
        if ":" not in kind and kind not in self.known:
            raise InputError(
                f"{setting}: no such {self.what}; {nearest(kind, self.known)}, or your own as package.module:Class"
            )
        module_name, _, class_name = self.known.get(kind, kind).partition(":")
        try:
            cls = getattr(importlib.import_module(module_name), class_name)
        except (Exception, SystemExit) as error:
            raise InputError(f"{setting}: cannot be imported: {raised(error)}") from error
        if not (inspect.isclass(cls) and all(callable(getattr(cls, name, None)) for name in self.methods)):
            methods = " and ".join(f"{name}({parameters})" for name, parameters in self.methods.items())
            raise InputError(f"{setting}: must be a class with the methods {methods}")
        return cls

    def takes(self, kind: str) -> Mapping[str, inspect.Parameter]:
        """Return the parameters of the constructor, by name.

        Raises:
            InputError: There is no such class.
        """
        return inspect.signature(self.find(kind)).parameters

    def may_take(self, kind: str, name: str) -> bool:
        """Say whether the constructor takes a parameter of this name."""
        parameters = self.takes(kind)
        return name in parameters or any(p.kind == inspect.Parameter.VAR_KEYWORD for p in parameters.values())

    def own(self, kind: str) -> list[str]:
        """List the parameters that are the user's choice."""
        return [name for name in self.takes(kind) if name not in self.bench_parameters]

    def unknown(self, kind: str, names: Iterable[str], common: Iterable[str] = ()) -> list[str]:
        """Find the fields of a section that are neither every class' nor this one's.

        Args:
            kind: The class' name.
            names: The fields.
            common: Fields that every class has.

        Returns:
            A clause for each.
        """
        known = {*common, *self.own(kind)}
        wrong = [name for name in names if name not in known and not self.may_take(kind, name)]
        return [f"{self.section}.{name}: no such field of {kind}; {nearest(name, known)}" for name in wrong]

    def check_names(self, kind: str, names: Iterable[str]) -> None:
        """Check that a class has parameters of these names.

        Raises:
            InputError: Unknown class or parameter.
        """
        if wrong := self.unknown(kind, names):
            raise InputError(wrong[0])

    def check_types(self, kind: str, parameters: Mapping[str, TomlValue]) -> None:
        """Check the types of parameters, such as text for a number.

        Raises:
            InputError: A parameter has a wrong type, or is the bench's to give.
        """
        cls = self.find(kind)
        types = fields_of(cls)
        for name, value in parameters.items():
            if name in self.bench_parameters:
                raise InputError(f"{self.section}.{name}: set by the bench, which gives it to every {self.what}")
            if name not in types:
                continue  # a name that the class does not have, or no class of pydantic's: its constructor decides
            adapter = TypeAdapter(types[name], config=ConfigDict(strict=True, allow_inf_nan=False))
            try:
                adapter.validate_json(json.dumps(value, default=as_json))
            except ValidationError as error:
                details = [{**detail, "loc": (name, *detail["loc"])} for detail in error.errors()]
                raise self._refused(kind, complaints(cls, details, parameters)) from error

    def make(self, kind: str, bench_arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        """Construct one.

        Args:
            kind: A name of `known`, or `package.module:Class`.
            bench_arguments: All that the bench may give it.
            parameters: The user's choice; those left out keep their defaults.

        Returns:
            The object.

        Raises:
            InputError: Unknown class or parameter, or one that it refuses.
        """
        cls = self.find(kind)
        self.check_names(kind, parameters)
        names = [name for name in self.always_given if self.may_take(kind, name)]
        names += [name for name in self.given_if_taken if name in self.takes(kind)]
        arguments = {name: bench_arguments[name] for name in names}
        try:
            return cls(**arguments, **parameters)
        except ValidationError as error:
            raise self._refused(kind, complaints(cls, error.errors(), {**arguments, **parameters})) from error
        except Exception as error:  # a user's own class may refuse its parameters in its own way
            raise InputError(f"{self.what} {kind}: {raised(error)}") from error

    def _refused(self, kind: str, clauses: list[str]) -> InputError:
        return InputError(f"{'; '.join(f'{self.section}.{clause}' for clause in clauses)} ({self.what} {kind})")


def as_json(value: Any) -> Any:
    """Numbers of numpy, for those who write a scenario in Python; a date of TOML, which no field takes."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
