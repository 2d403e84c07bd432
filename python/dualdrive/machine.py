"""A machine: an assembly of the core with a name, an axis, a file and a history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from dualdrive import _core
from dualdrive.files import refuse_existing, write_atomically
from dualdrive.machine_file import (
    DEFAULT,
    Layer,
    MachineError,
    Structure,
    add_effect,
    build,
    history_of,
    is_choice,
    parse_layer,
    preset_names,
    read_layers,
    set_value,
    spoken_choice,
    unit_on_axis,
)

if TYPE_CHECKING:
    from dualdrive.machine_file.undo import State

__all__ = ["DEFAULT", "Machine", "MachineError", "Parameter", "presets"]


def presets() -> list[str]:
    """Names of the machines that come with dualdrive, the default first."""
    return preset_names()


@dataclass(frozen=True)
class Parameter:
    """One declared number of a machine, in SI: path, unit, bounds, default, usual size, value."""

    path: str
    unit: str
    low: float
    high: float
    low_excluded: bool
    standard: float
    typical: float
    value: float
    doc: str


class Machine:
    """A machine that can be changed, simulated and saved.

    core:     the assembly as the C++ core has it; numbers may be set there directly
    name:     short name, title: one line of text
    axis:     ``rotary``, or ``linear`` where the table side counts in m, N and kg
    history:  what was changed, oldest first: dicts with date, command, change, undo (the way back:
              :mod:`dualdrive.machine_file.undo`)
    """

    def __init__(
        self,
        core: _core.Machine,
        structure: Structure,
        layers: list[Layer],
        *,
        title: str,
        history: tuple[dict[str, str], ...],
    ) -> None:
        self.core = core
        self.title = title
        self.history = history
        self._structure = structure
        self._layers = layers
        self._noted = self._state()

    # --- files ------------------------------------------------------------------------------------

    @classmethod
    def load(cls, source: str | Path = DEFAULT) -> Self:
        """Read a machine file, or a preset by its name.

        Raises MachineError or FileError: one line naming file, key, value, rule and way out.
        """
        return cls._of(read_layers(source))

    @classmethod
    def from_toml(cls, text: str, where: str = "machine") -> Self:
        """Read the text of a machine file; `where` is how errors call it. Raises MachineError."""
        layer = parse_layer(where, text)
        below = read_layers(layer.data["base"]) if "base" in layer.data else []
        return cls._of([*below, layer])

    @classmethod
    def _of(cls, layers: list[Layer]) -> Self:
        core, structure = build(layers)
        titles = [layer.data["title"] for layer in layers if "title" in layer.data]
        title = titles[-1] if titles else core.name
        return cls(core, structure, layers, title=title, history=history_of(layers[-1]))

    def toml(self) -> str:
        """The text of a machine file that stands on its own; reads back to the same bits."""
        from dualdrive.machine_file.text import compose

        return compose(
            self._layers, self.core, name=self.name, title=self.title, history=self.history
        )

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the machine file, whole or not at all.

        Raises FileError where the file is there already (unless `overwrite`) or can't be written.
        """
        path = Path(path)
        refuse_existing(path, overwrite=overwrite)
        text = self.toml()
        with write_atomically(path, overwrite=overwrite) as temporary:
            temporary.write_text(text, "utf-8")

    # --- description ------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Short name, the file's stem unless the file says otherwise."""
        return self.core.name

    @name.setter
    def name(self, name: str) -> None:
        self.core.name = name

    @property
    def axis(self) -> str:
        """``rotary`` or ``linear``."""
        return self._structure.axis

    @property
    def drive_train(self) -> str:
        """How the machine is put together: dual_servo, single_motor, double_pinion or rigid."""
        return self._structure.drive_train

    @property
    def effects(self) -> list[str]:
        """Labels of the effects in the machine, such as ``coulomb@table``."""
        return [str(effect["label"]) for effect in self.core.effects]

    def unit_of(self, name: str, unit: str) -> str:
        """The unit of a parameter or signal on this axis, from the one the core declares."""
        rigid = self.drive_train == "rigid"
        return unit_on_axis(name, unit, axis=self.axis, rigid=rigid)

    def parameters(self) -> list[Parameter]:
        """Every parameter with its declaration and value; units are those of the axis."""
        return [self._described(p) for p in self.core.parameters()]

    def parameter(self, path: str) -> Parameter:
        """The declaration of a path or tie group (of its first member).

        Raises MachineError naming near paths.
        """
        try:
            return self._described(self.core.parameter(path))
        except ValueError as error:
            raise MachineError(f"{self.name}: {error}") from None

    def _described(self, p: Any) -> Parameter:
        return Parameter(
            path=p.path,
            unit=self.unit_of(p.path, p.unit),
            low=p.low,
            high=p.high,
            low_excluded=p.low_excluded,
            standard=p.standard,
            typical=p.typical,
            value=p.value,
            doc=p.doc,
        )

    # --- numbers and effects ----------------------------------------------------------------------

    def get(self, path: str) -> float:
        """The SI value at a path, or the one that all members of a group agree on.

        Raises MachineError naming near paths.
        """
        try:
            return float(self.core.get(path))
        except ValueError as error:
            raise MachineError(f"{self.name}: {error}") from None

    def set(self, path: str, value: float | str | Mapping[str, Any]) -> None:
        """Set a number: SI, text with a unit (``20arcsec``), or a table for a gap's frame.

        A choice can be set too: ``meshes.kind``, ``controller.equaliser``, ``drives``.
        Raises MachineError naming path, value, rule and way out; nothing is changed then.
        """
        if is_choice(path):
            self._choose(path, value)
        else:
            before = self.core.copy()
            set_value(self.core, self._structure, path, value, self.name)
            self._refuse_idle(before, path)

    def _refuse_idle(self, before: _core.Machine, path: str) -> None:
        """A number that no law reads would be a setting without consequence."""
        idle = self.core.unread(path)
        members = self.core.members(path)
        if idle and any(self.core.get(p) != before.get(p) for p in members):
            self.core = before
            raise MachineError(
                f"{self.name}: {path}: nothing reads it, for {idle}; "
                f"choose another {path.rpartition('.')[0]}.kind first"
            )

    def _choose(self, path: str, value: Any) -> None:
        """Put the machine together anew: a choice decides which parts and numbers there are."""
        from dualdrive.machine_file.text import choose

        text = choose(self.toml(), path, spoken_choice(value))
        layers = [parse_layer(self.name, text)]
        self.core, self._structure = build(layers)
        self._layers = layers

    def add(self, effect: str, place: str | None = None, /, **parameters: Any) -> str:
        """Add an effect; returns its label. ``add("coulomb", "table", torque="2 kN*m")``.

        effect may carry its place: ``coulomb@table``. An expression takes `formula`,
        `parameters` (name -> number or {value, unit}) and `columns` (recorded column -> unit); a
        spline `coordinate`, `low`, `high` and `values` at evenly spaced knots, or `knots`, how
        many, for a curve of zeros (two of each for a surface). Raises MachineError.
        """
        name, _, at = effect.partition("@")
        entry = {"effect": name, "place": place or at or _usual_place(name), **parameters}
        return add_effect(self.core, self._structure, entry, self.name)

    def remove(self, label: str) -> None:
        """Take an effect out by its label. Raises MachineError."""
        try:
            self.core.remove_effect(label)
        except ValueError as error:
            raise MachineError(f"{self.name}: {error}") from None

    # --- history ----------------------------------------------------------------------------------

    def note(self, change: str, command: str = "") -> None:
        """Add a line to the history: what changed since the line before, and by which command."""
        from dualdrive.machine_file.undo import way_back

        now = self._state()
        entry = {
            "date": date.today().isoformat(),
            "command": command,
            "change": change,
            "undo": way_back(self._noted, now),
        }
        self.history += ({key: value for key, value in entry.items() if value},)
        self._noted = now

    def undo(self) -> str:
        """Take back the last step of the history, exactly; returns what it was.

        Raises MachineError where there is none, where the history lacks the way back, or where the
        machine was changed since; nothing is changed then.
        """
        from dualdrive.machine_file.undo import undone

        if not self.history:
            raise MachineError(f"{self.name}: the history is empty; there is nothing to undo")
        was = undone(self._state(), self.history[-1])
        *earlier, last = self.history
        self.core, self._structure, self._layers = was.core, was.structure, list(was.layers)
        self.title, self.history = was.title, tuple(earlier)
        self._noted = self._state()
        return last.get("change", "")

    def _state(self) -> State:
        from dualdrive.machine_file.undo import State

        return State(self.core.copy(), self._structure, tuple(self._layers), self.title)

    # --- copies -----------------------------------------------------------------------------------

    def copy(self) -> Self:
        """An independent copy."""
        copy = type(self)(
            self.core.copy(),
            self._structure,
            self._layers,
            title=self.title,
            history=self.history,
        )
        copy._noted = self._noted
        return copy

    def __repr__(self) -> str:
        return f"<Machine {self.name}: {self.title}>"

    def _repr_html_(self) -> str:
        import dualdrive  # its lazy name: the description itself knows what a machine is

        return dualdrive.describe.html(self)


def _usual_place(effect: str) -> str:
    """The first place that an effect names for itself."""
    try:
        return str(_core.effect_type(effect).places.split(",")[0])
    except ValueError as error:
        raise MachineError(str(error)) from None
