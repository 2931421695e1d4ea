"""Notes: what a reader, scene or result leaves out or changes, and how it matters.

A note is a sentence, so that it prints and is written to files as one. It is `reached` where the result depends on what
was left out, and then the result is not known.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any, Final, Literal, get_args

Matter = Literal["information", "changes", "reached"]
Omission = Literal["", "force", "loop", "servo", "gravity", "limit", "contact", "friction"]
MATTERS: Final[tuple[Matter, ...]] = get_args(Matter)
OMISSIONS: Final[tuple[Omission, ...]] = get_args(Omission)
_ORDER: Final = {matter: k for k, matter in enumerate(("reached", "changes", "information"))}


class Note(str):
    """A sentence on what a result leaves out or changes.

    Attributes:
        matter: "information"; "changes": what is left out can change the result; or "reached": it does.
        omits: What of a file is left out that acts on the motion: "force", "loop", "servo" or "gravity"; or is
            reached by it: "limit", "contact" or "friction"; empty: nothing.
        joints: The joints on which an omitted servo acts.
        where: The file that says it; empty where it is not of a file.
        time: When it is reached first, s; None where it is not reached, or always is.

    Example:
        >>> note = Note("the elbow leaves its range.", "reached", time=0.5)
        >>> note.matter, note.time, note == "the elbow leaves its range."
        ('reached', 0.5, True)
    """

    matter: Matter
    omits: Omission
    joints: tuple[str, ...]
    where: str
    time: float | None

    def __new__(
        cls,
        text: str,
        matter: Matter = "information",
        omits: Omission = "",
        joints: Iterable[str] = (),
        where: str = "",
        time: float | None = None,
    ) -> Note:
        """A note of this text."""
        note = super().__new__(cls, text)
        note.matter, note.omits, note.joints, note.where, note.time = matter, omits, tuple(joints), where, time
        return note

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (str(self), self.matter, self.omits, self.joints, self.where, self.time)

    @property
    def label(self) -> str:
        """What a table calls it: "not known" where it is reached, else "note"."""
        return "not known" if self.matter == "reached" else "note"

    def updated(self, **changes: Any) -> Note:
        """A copy with other values of these attributes."""
        return Note(str(self), **{**vars(self), **changes})

    def as_dict(self) -> dict[str, Any]:
        """The note as data that JSON can hold."""
        found = {"text": str(self), "matter": self.matter, "file": self.where or None, "time": self.time}
        return {key: value for key, value in found.items() if value is not None}

    def record(self) -> dict[str, Any]:
        """All of the note as data that JSON can hold; `Note(**record)` is the note again."""
        return {"text": str(self), **vars(self), "joints": list(self.joints)}

    def data(self) -> str | dict[str, Any]:
        """The note as an entry of a scene's key `notes`: its text, or a mapping where it is more than information."""
        said = {"matter": self.matter, "omits": self.omits, "joints": list(self.joints), "file": self.where}
        kept = {key: value for key, value in said.items() if value}
        return str(self) if self.matter == "information" else {"text": str(self), **kept}


class WithNotes:
    """A result of a file. Its `notes` are those of its warnings that say what of the file is left out or changed."""

    warnings: tuple[str, ...]

    @property
    def notes(self) -> tuple[Note, ...]:
        """What of the file is left out or changed, and how it matters."""
        return ranked(text for text in self.warnings if isinstance(text, Note))


def as_note(text: str) -> Note:
    """A sentence as a note; one that is none yet becomes information."""
    return text if isinstance(text, Note) else Note(text)


def ranked(notes: Iterable[str]) -> tuple[Note, ...]:
    """The notes, each once, those that matter most first, otherwise in their order."""
    each = (as_note(text) for text in dict.fromkeys(notes))
    return tuple(sorted(each, key=lambda note: _ORDER[note.matter]))


def reached(notes: Iterable[str]) -> tuple[Note, ...]:
    """Those of the notes that are reached."""
    return tuple(note for note in map(as_note, notes) if note.matter == "reached")


def in_use(notes: Iterable[str], driven: Collection[str] | None, gravity: bool) -> tuple[Note, ...]:
    """Notes on a file, with what is left out "reached" where it acts.

    Args:
        notes: The notes.
        driven: The joints at which something else replaces the servos of the file; None: all of them.
        gravity: Whether there is gravity.
    """
    found = []
    for note in map(as_note, notes):
        idle = [joint for joint in note.joints if driven is not None and joint not in driven]
        if note.omits in ("force", "loop") or (note.omits == "gravity" and gravity) or (note.omits == "servo" and idle):
            found.append(note.updated(matter="reached"))
        else:
            found.append(note.updated(matter="information") if note.omits in ("servo", "gravity") else note)
    return tuple(found)
