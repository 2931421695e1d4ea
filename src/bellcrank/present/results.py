"""What all results have in common: a table, rows as CSV and for pandas, data as JSON, and notes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files.atomic_write import write_text
from bellcrank.files.csv_files import csv_text
from bellcrank.files.json_files import json_text
from bellcrank.notes import Note

if TYPE_CHECKING:
    import pandas


class JsonLayout(NamedTuple):
    """Of a JSON file: blanks a level, and whether characters beyond ASCII are escaped."""

    indent: int
    ascii_only: bool = False


class Result(ABC):
    """What a function of bellcrank found.

    `print` shows `table`. `to_csv` writes the rows that the class describes, and `to_pandas` gives them as a DataFrame;
    `to_json` writes `as_dict`. `notes` say what was left out or changed.
    """

    json_layout: ClassVar = JsonLayout(2)

    if TYPE_CHECKING:  # a property of some results, data of others

        @property
        def notes(self) -> tuple[Note, ...]:
            """What was left out or changed, those that matter most first."""

    @abstractmethod
    def table(self) -> str:
        """The result as text for a terminal.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.mobility("pendulum").table().splitlines()[0])
            1 degree of freedom: 1 of the joints less 0 independent conditions of 0
        """

    def __str__(self) -> str:
        return self.table()

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.table())}</pre>"

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """The result as data for JSON.

        Returns:
            Texts, numbers in SI units, lists and dictionaries.

        Example:
            >>> import bellcrank as bc
            >>> bc.mobility("pendulum").as_dict()["freedoms"]
            1
        """

    @abstractmethod
    def _rows(self) -> list[Sequence[object]]:
        """The rows of `to_csv`, first the header with units; a cell of what is not known is empty."""

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
        return _written(path, csv_text(self._rows()))

    def to_pandas(self) -> pandas.DataFrame:
        """The rows of `to_csv` as a DataFrame of pandas.

        Returns:
            A row each, with units in the names of the columns; NaN where something is not known.

        Raises:
            InputError: The package pandas is not installed.

        Example:
            >>> import bellcrank as bc
            >>> bc.size("geared_pendulum").to_pandas()["joint"].tolist()
            ['shoulder']
        """
        try:
            import pandas
        except ImportError:
            raise InputError("to_pandas requires the package pandas: pip install pandas") from None
        header, *rows = self._rows()
        return pandas.DataFrame(
            [[math.nan if cell == "" else cell for cell in row] for row in rows], columns=list(header)
        )


def _written(path: str | Path, text: str) -> Path:
    target = arguments.path("path", path, "the path of a file")
    write_text(target, text)
    return target
