"""The result of a linearisation: matrices with named states, inputs and outputs, and modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bellcrank import arguments
from bellcrank.analysis.modes import Mode, pair
from bellcrank.arrays import Array, Complex
from bellcrank.dynamics.inverse.drive_loops import DriveDynamics
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.atomic_write import writing
from bellcrank.notes import Note
from bellcrank.present.plot_style import write_figure
from bellcrank.present.results import JsonLayout, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EQUILIBRIUM, STEADY_MOTION, MOVING = "equilibrium", "relative equilibrium", "not steady"
MOST_NAMED = 6  # modes that grow; of more, their count is given


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearisation(Result):
    """Linear equations ẋ = A x + B u, y = C x + D u of small deviations from an operating point.

    Made by `linearise`. A state "NAME" is a deviation of a coordinate and "NAME rate" of its velocity; those of a free
    base are along and about its own axes ("x", "rotation x"). `to_csv` writes one row a mode.

    Attributes:
        name: The scene's name.
        kind: "equilibrium"; "relative equilibrium", a steady motion, whose equations hold in the frame that moves
            along; or "not steady", where A belongs to one moment of a motion only and its eigenvalues say nothing of
            stability.
        time: s.
        position: q (nq,) of the operating point.
        velocity: v (nv,) of the operating point; that of a free base in its own axes.
        states: (name, unit) of each state (n).
        inputs: (name, unit) of each input (m).
        outputs: (name, unit) of each output (p).
        A: (n, n).
        B: (n, m).
        C: (p, n).
        D: (p, m).
        modes: The modes by rising |λ|, those along symmetries last; empty if the kind is "not steady".
        symmetries: The motions along which nothing changes.
        symmetries_removed: Whether they are left out of the states, as for a relative equilibrium.
        residual: |f| or, in the moving frame, |f − X|, as a share of the terms of the equations.
        notes: What else to know about the result.
        drives: The dynamics of each drive of the scene.

    Example:
        >>> import bellcrank as bc
        >>> linear = bc.linearise(bc.load_scene("pendulum"))
        >>> linear.kind, linear.A.round(3).tolist()
        ('equilibrium', [[0.0, 1.0], [-9.81, 0.0]])
    """

    name: str
    kind: str
    time: float
    position: Array
    velocity: Array
    states: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, str], ...]
    A: Array
    B: Array
    C: Array
    D: Array
    modes: tuple[Mode, ...]
    symmetries: tuple[str, ...]
    symmetries_removed: bool
    residual: float
    notes: tuple[Note, ...]
    drives: tuple[DriveDynamics, ...] = ()
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"Linearisation('{self.name}', {self.kind}, {sizes})"

    @property
    def steady(self) -> bool:
        """Whether the operating point is an equilibrium or a relative equilibrium."""
        return self.kind != MOVING

    @property
    def eigenvalues(self) -> Complex:
        """All eigenvalues (n,), 1/s, in the order of the modes, conjugate ones side by side.

        Raises:
            InputError: The operating point is not steady; `frozen_eigenvalues` are those of A at this moment.

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum")).eigenvalues.round(4).tolist()
            [3.1321j, -3.1321j]
        """
        if not self.steady:
            raise InputError(
                f"{self.name}: the operating point at {self.time:g} s is neither an equilibrium nor a steady motion "
                f"(residual {self.residual:.2g}), so that eigenvalues say nothing of stability; those of A at this "
                "moment are in frozen_eigenvalues, and bc.floquet takes a periodic motion"
            )
        found: list[complex] = []
        for mode in self.modes:
            found += [mode.eigenvalue, mode.eigenvalue.conjugate()] if mode.oscillates else [mode.eigenvalue]
        return np.array(found, dtype=np.complex128)

    @property
    def frozen_eigenvalues(self) -> Complex:
        """The eigenvalues (n,) of A, 1/s, whatever the operating point.

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum"), at=0.3).frozen_eigenvalues.shape
            (2,)
        """
        values = np.linalg.eigvals(self.A) if self.A.size else np.zeros(0)
        return np.asarray(values, dtype=np.complex128)

    @property
    def stable(self) -> bool | None:
        """Whether no mode grows; None where the operating point is not steady. Undamped oscillations do not grow."""
        if not self.steady:
            return None
        return all(mode.eigenvalue.real <= 0.0 for mode in self.modes)  # rounding errors are 0 (modes.py)

    @property
    def drifts(self) -> bool:
        """Whether a push at rest is not stopped and moves it away along a symmetry, such as a cart without friction.

        There, a neutral velocity belongs to a neutral position, and the position grows linearly.
        """
        neutral = [mode.symmetry for mode in self.modes if mode.eigenvalue == 0.0]
        return self.kind == EQUILIBRIUM and not self.symmetries_removed and True in neutral and False in neutral

    @property
    def stability(self) -> str:
        """The answer of `stable` in words; empty where the operating point is not steady.

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum")).stability
            'stable'
        """
        if self.stable is None:
            return ""
        if self.stable and self.drifts:
            return "neutral: nothing grows, and a push along its symmetries is not stopped"
        if self.stable:
            placed = not self.symmetries or self.symmetries_removed
            return "stable" if placed else "stable but for its place along its symmetries"
        growing = [number for number, mode in enumerate(self.modes, 1) if mode.eigenvalue.real > 0.0]
        if len(growing) == 1:
            return f"unstable: mode {growing[0]} grows"
        if len(growing) > MOST_NAMED:
            return f"unstable: {len(growing)} of {len(self.modes)} modes grow"
        return f"unstable: modes {', '.join(map(str, growing))} grow"

    # ---- to read

    @property
    def description(self) -> str:
        """The kind of the operating point in words.

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum")).description
            'equilibrium'
        """
        return {
            EQUILIBRIUM: "equilibrium",
            STEADY_MOTION: "relative equilibrium (a steady motion, seen in the frame that moves along)",
            MOVING: f"not steady (residual {self.residual:.2g}): neither an equilibrium nor a steady motion",
        }[self.kind]

    @property
    def mode_header(self) -> tuple[str, ...]:
        """The titles of the columns of `mode_rows`."""
        return "mode", "eigenvalue [1/s]", "frequency [Hz]", "damping ratio", "time constant [s]", "kind", "moves most"

    def mode_rows(self) -> list[tuple[str, ...]]:
        """The table of modes as texts.

        Returns:
            The cells of each row.

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum")).mode_rows()[0][:4]
            ('1', '0 ± 3.13209i', '0.498488', '0')
        """
        from bellcrank.analysis.modes import mode_cells

        return [(str(k + 1), *mode_cells(self, mode)) for k, mode in enumerate(self.modes)]

    def table(self) -> str:
        """The operating point and its modes as text for a terminal.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.linearise(bc.load_scene("pendulum")).table().splitlines()[0])
            Simple pendulum: equilibrium, stable
        """
        from bellcrank.analysis.modes import mode_table

        return mode_table(self)

    # ---- other formats

    def as_dict(self) -> dict[str, Any]:
        """The result as data that JSON can hold.

        Returns:
            Matrices, names and modes; complex numbers as [real, imaginary].

        Example:
            >>> import bellcrank as bc
            >>> bc.linearise(bc.load_scene("pendulum")).as_dict()["states"]
            [['swing', 'rad'], ['swing rate', 'rad/s']]
        """
        return {
            "name": self.name,
            "kind": self.kind,
            "stable": self.stable,
            "time": self.time,
            "position": self.position.tolist(),
            "velocity": self.velocity.tolist(),
            "states": [list(entry) for entry in self.states],
            "inputs": [list(entry) for entry in self.inputs],
            "outputs": [list(entry) for entry in self.outputs],
            "A": self.A.tolist(),
            "B": self.B.tolist(),
            "C": self.C.tolist(),
            "D": self.D.tolist(),
            "modes": [mode.as_dict() for mode in self.modes],
            "frozen_eigenvalues": [pair(x) for x in self.frozen_eigenvalues.tolist()],
            "symmetries": list(self.symmetries),
            "symmetries_removed": self.symmetries_removed,
            "residual": self.residual,
            "notes": [note.as_dict() for note in self.notes],
            "drives": [drive.as_dict() for drive in self.drives],
        }

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = [
            ["mode", "real part [1/s]", "imaginary part [1/s]", "frequency [Hz]", "damping ratio", "time constant [s]",
             "kind"]
        ]  # fmt: skip
        for number, mode in enumerate(self.modes, 1):
            known = (mode.frequency if mode.oscillates else None, mode.damping_ratio, mode.time_constant)
            rows.append([number, *pair(mode.eigenvalue), *("" if it is None else it for it in known), mode.kind])
        return rows

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the eigenvalues in the complex plane, with the numbers of their modes.

        Args:
            path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: The operating point is not steady, the picture format is unknown, or the file cannot be
                written.

        Example:
            >>> import bellcrank as bc
            >>> len(bc.linearise("pendulum").plot().axes)
            1
        """
        from bellcrank.analysis.root_locus_plot import plot_eigenvalues

        target = arguments.picture(path)
        assert len(self.eigenvalues) >= len(self.modes)  # raises where they say nothing of stability
        return write_figure(plot_eigenvalues(self), target)

    def to_mat(self, path: str | Path) -> None:
        """Write A, B, C, D, the names and the eigenvalues as a MATLAB file, for ss(A, B, C, D).

        Args:
            path: The .mat file to write.

        Raises:
            InputError: The file cannot be written.

        Example:
            >>> import tempfile, pathlib, bellcrank as bc
            >>> file = pathlib.Path(tempfile.mkdtemp()) / "pendulum.mat"
            >>> bc.linearise(bc.load_scene("pendulum")).to_mat(file)
            >>> from scipy.io import loadmat
            >>> loadmat(file)["A"].round(2).tolist()
            [[0.0, 1.0], [-9.81, 0.0]]
        """
        from scipy.io import savemat

        def cells(entries: tuple[tuple[str, str], ...]) -> Any:
            found = np.empty((len(entries), 1), dtype=object)  # a cell array of texts
            found[:, 0] = [f"{name} [{unit}]" for name, unit in entries]
            return found

        data = {
            "A": self.A, "B": self.B, "C": self.C, "D": self.D, "kind": self.kind, "name": self.name,
            "states": cells(self.states), "inputs": cells(self.inputs), "outputs": cells(self.outputs),
            "position": self.position, "velocity": self.velocity,
        }  # fmt: skip
        data["eigenvalues" if self.steady else "frozen_eigenvalues"] = (
            self.eigenvalues if self.steady else self.frozen_eigenvalues
        )
        with writing(arguments.path("path", path)) as file:
            savemat(file, data, appendmat=False)

    def to_control(self) -> Any:
        """The state space of python-control, with the names of states, inputs and outputs.

        Returns:
            control.StateSpace.

        Raises:
            BellcrankError: python-control is not installed.

        Example:
            >>> import bellcrank as bc
            >>> system = bc.linearise(bc.load_scene("pendulum")).to_control()
            >>> system.nstates, system.state_labels
            (2, ['swing', 'swing rate'])
        """
        try:
            import control
        except ImportError:
            raise BellcrankError("to_control requires the package python-control: pip install control") from None

        def plain(entries: tuple[tuple[str, str], ...]) -> list[str]:
            return [name.replace(".", "_") for name, _ in entries]  # names with dots stand for signals of subsystems

        return control.ss(
            self.A, self.B, self.C, self.D,
            states=plain(self.states), inputs=plain(self.inputs), outputs=plain(self.outputs), name=self.name,
        )  # fmt: skip
