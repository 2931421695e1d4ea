"""The files that results of all kinds write: their data as JSON, their rows as CSV."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from bellcrank import arguments
from bellcrank.files.atomic_write import write_text
from bellcrank.files.json_files import json_text


class JsonLayout(NamedTuple):
    """Of a JSON file: blanks a level, and whether characters beyond ASCII are escaped."""

    indent: int
    ascii_only: bool = False


class WithJson(ABC):
    """A result that `as_dict` gives as data, which `to_json` writes."""

    json_layout: ClassVar = JsonLayout(2)

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON."""

    def to_json(self, path: str | Path) -> Path:
        """Write `as_dict` as JSON, with null for numbers that are not finite.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> bc.judge("geared_pendulum").to_json("judge.json").name
            'judge.json'
        """
        return _written(path, json_text(self.as_dict(), **self.json_layout._asdict()))


class WithCsv(ABC):
    """A result whose rows `to_csv` writes."""

    @abstractmethod
    def _csv_text(self) -> str:
        """The text of the file."""

    def to_csv(self, path: str | Path) -> Path:
        """Write the rows that the class describes as CSV, with units in the header.

        Args:
            path: The file, which is replaced in one step.

        Returns:
            The path of the file. Cells of what is not known are empty.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import bellcrank as bc
            >>> bc.size("geared_pendulum").to_csv("pendulum.csv").name
            'pendulum.csv'
        """
        return _written(path, self._csv_text())


def _written(path: str | Path, text: str) -> Path:
    target = arguments.path("path", path, "the path of a file")
    write_text(target, text)
    return target
