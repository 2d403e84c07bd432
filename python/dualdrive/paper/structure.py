"""A machine's control structure as blocks and arrows, read from the machine itself.

What the controller has not, the diagram has not: an integral time of 0 leaves a P, a lag of 0 no
block, an equaliser on one drive one arrow, a rigid gearbox no spring.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from dualdrive.machine import Machine
from dualdrive.paper.settings import short
from dualdrive.units import human

__all__ = ["Arrow", "Block", "Diagram", "structure"]

Shape = Literal["box", "sum", "limit", "delay", "gap", "body"]

#: rows are this far apart; the position loop and the table lie between them
_ROW: Final = 3.0


@dataclass(frozen=True)
class Block:
    """A block: what it is called, what is written in it, and where it stands (column, row)."""

    name: str
    text: str
    shape: Shape
    x: float
    y: float


@dataclass(frozen=True)
class Arrow:
    """A signal from block to block. at: the row that it runs along where it isn't straight."""

    source: str
    target: str
    text: str = ""
    at: float | None = None
    sign: str = ""


@dataclass(frozen=True)
class Diagram:
    """Blocks and arrows of one machine."""

    title: str
    blocks: tuple[Block, ...]
    arrows: tuple[Arrow, ...]

    def __getitem__(self, name: str) -> Block:
        return next(block for block in self.blocks if block.name == name)

    def __contains__(self, name: object) -> bool:
        return any(block.name == name for block in self.blocks)

    def dot(self) -> str:
        """The same in the language of Graphviz."""
        lines = ["digraph control {", "  rankdir=LR;", "  node [shape=box];"]
        for block in self.blocks:
            text = block.text.replace("\n", "\\n").replace('"', '\\"')
            form = " shape=circle" if block.shape == "sum" else ""
            lines.append(f'  "{block.name}" [label="{text}"{form}];')
        for arrow in self.arrows:
            text = " ".join(filter(None, (arrow.sign, arrow.text)))
            lines.append(f'  "{arrow.source}" -> "{arrow.target}" [label="{text}"];')
        return "\n".join([*lines, "}"]) + "\n"


class _Sketch:
    """What is drawn so far of a machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.options = machine.core.controller_options
        self.drives = range(1, len(machine.core.motors) + 1)
        self.blocks: list[Block] = []
        self.arrows: list[Arrow] = []

    def block(self, name: str, text: str, shape: Shape, x: float, y: float) -> str:
        """Add a block; returns its name."""
        self.blocks.append(Block(name, text, shape, x, y))
        return name

    def arrow(
        self, source: str, target: str, text: str = "", at: float | None = None, sign: str = ""
    ) -> None:
        """Add an arrow."""
        self.arrows.append(Arrow(source, target, text, at, sign))

    def number(self, path: str) -> float:
        """A number of the controller."""
        return self.machine.get(f"controller.{path}")

    def words(self, path: str) -> str:
        """A number with its unit, as people write it; without a part it is the controller's."""
        whole = path if "." in path else f"controller.{path}"
        unit = self.machine.parameter(whole).unit
        return human(self.machine.get(whole), unit).replace(" 1/", "/")

    def row(self, drive: int) -> float:
        """The row of a drive: the first above, the others below; one alone in the middle."""
        return _ROW * ((len(self.drives) - 1) / 2 - (drive - 1))


def structure(machine: Machine) -> Diagram:
    """The diagram of a machine, with or without a controller."""
    sketch = _Sketch(machine)
    controlled = sketch.options["kind"] != "none"
    if controlled:
        _position_loop(sketch)
    for drive in sketch.drives:
        if controlled:
            _speed_loop(sketch, drive)
        _motor(sketch, drive, controlled=controlled)
    _mechanics(sketch)
    if controlled:
        _feedback(sketch)
        if len(sketch.drives) > 1:
            _equaliser(sketch)
    return Diagram(machine.title, tuple(sketch.blocks), tuple(sketch.arrows))


def _position_loop(s: _Sketch) -> None:
    """Reference, position controller, feed-forward, limit and command lag."""
    s.block("reference", "θ_ref", "body", 0, 0)
    s.block("e", "", "sum", 1, 0)
    s.arrow("reference", "e", sign="+")
    parts = [f"{name} {s.words(name)}" for name in ("K_v", "K_i", "K_d") if s.number(name)]
    kind = "".join(letter for letter, name in zip("PID", ("K_v", "K_i", "K_d"), strict=True)
                   if s.number(name))  # fmt: skip
    s.block("position", _lines(f"position {kind or '0'}", *parts, _sampled(s, "position")),
            "box", 2.2, 0)  # fmt: skip
    s.arrow("e", "position", "e")
    s.block("limit", "i_m, ± Ω_max", "limit", 4.5, 0)
    if s.number("f_v"):
        s.block("command", "", "sum", 3.4, 0)
        s.arrow("position", "command", sign="+")
        s.block("feed-forward", _lines("feed-forward", f"f_v {s.words('f_v')}"), "box", 2.2, 1.5)
        s.arrow("reference", "feed-forward", "ω_ref")
        s.arrow("feed-forward", "command", sign="+")
        s.arrow("command", "limit")
    else:
        s.arrow("position", "limit")
    if s.number("delta_c"):
        s.block("command lag", _lines("command lag", s.words("delta_c")), "delay", 5.7, 0)
        s.arrow("limit", "command lag")


def _speed_loop(s: _Sketch, n: int) -> None:
    """From the speed command to the motor's terminals."""
    y = s.row(n)
    source = "command lag" if s.number("delta_c") else "limit"
    s.block(f"speed sum {n}", "", "sum", 7.9, y)
    if n > 1 and s.number("delta_t"):
        s.block(f"slave lag {n}", _lines("slave lag δt", s.words("delta_t")), "delay", 6.95, y)
        s.arrow(source, f"slave lag {n}")
        s.arrow(f"slave lag {n}", f"speed sum {n}", sign="+")
    else:
        s.arrow(source, f"speed sum {n}", f"Ω_{n}" if len(s.drives) > 1 else "Ω", sign="+")
    integral = bool(s.number("T_N"))
    text = _lines(
        f"speed {'PI' if integral else 'P'} {n}",
        f"k_p {short(s.number('k_p'))}",
        f"T_N {s.words('T_N')}" if integral else "",
        f"± {s.words(f'motor_{n}.T_max')}",
        _sampled(s, "speed"),
    )
    s.block(f"speed {n}", text, "box", 9.1, y)
    s.arrow(f"speed sum {n}", f"speed {n}")
    if s.machine.core.kind(f"motor_{n}") == "armature":
        cascade = s.options["current"] == "cascade"
        own = f"ω_ci {s.number('omega_ci'):.3g}/s" if cascade else ""
        name = "current PI" if cascade else "no current loop"
        limit = f"± U_max {s.words(f'motor_{n}.U_max')}"
        text = _lines(f"{name} {n}", own, limit, _sampled(s, "current"))
        s.block(f"current {n}", text, "box", 10.6, y)
        s.arrow(_filter(s, n, y), f"current {n}", f"T_{n}*")
        if cascade:
            s.arrow(
                f"motor {n}", f"current {n}", f"EMF C_e ω_{n}", at=y + 0.78 * _aside(y), sign="+"
            )


def _filter(s: _Sketch, n: int, y: float) -> str:
    """The last block before the current loop or the motor: a set-point filter, if there is one."""
    motor = f"motor_{n}"
    pole, zero = (s.machine.get(f"{motor}.filter_{part}") for part in ("pole", "zero"))
    if not pole:
        return f"speed {n}"
    kind = "low-pass" if not zero else "notch" if zero == pole else "filter"
    s.block(f"filter {n}", _lines(f"set-point {kind}", s.words(f"{motor}.filter_pole")), "box",
            9.85, y)  # fmt: skip
    s.arrow(f"speed {n}", f"filter {n}")
    return f"filter {n}"


def _aside(y: float) -> float:
    """How far beside a drive's row what comes back to it runs: outwards."""
    return 0.85 if y > 0 else -0.85


def _motor(s: _Sketch, n: int, *, controlled: bool) -> None:
    y = s.row(n)
    direct = s.machine.core.kind(f"motor_{n}") == "direct"
    s.block(f"motor {n}", _lines(f"motor {n}", "torque source" if direct else "R, L, C_e, K_d"),
            "body", 11.8, y)  # fmt: skip
    if controlled:
        last = _filter(s, n, y) if direct else f"current {n}"
        s.arrow(last, f"motor {n}", f"T_{n}*" if direct else f"U_{n}")
    else:
        s.block(f"input {n}", f"T_{n}" if direct else f"U_{n}", "body", 10.5, y)
        s.arrow(f"input {n}", f"motor {n}")


def _mechanics(s: _Sketch) -> None:
    """Bodies and what joins them, motor to table."""
    core, motors = s.machine.core, len(s.drives)
    inertia = "J" if s.machine.axis == "rotary" else "m"
    s.block(
        "table", _lines("table", f"{inertia} {short(s.machine.get('table.J'))}"), "body", 16.6, 0
    )
    pinions = [name for name in core.bodies if name.startswith("pinion_")]
    for name in pinions:
        n = int(name.removeprefix("pinion_"))
        y = s.row(n) if n <= motors else -_ROW
        s.block(f"pinion {n}", f"pinion {n}", "body", 14.2, y)
        if f"gearbox_{n}" in core.connections:
            _gearbox(s, n, y)
        _mesh(s, n, f"pinion {n}", y)
    if "split_shaft" in core.connections:
        s.arrow("pinion 1", "pinion 2", "preloaded spring")
    if not pinions:
        _mesh(s, 1, "motor 1", 0.0)


def _gearbox(s: _Sketch, n: int, y: float) -> None:
    """A rigid one is a ratio on its arrow, any other a block of its own."""
    name = f"gearbox_{n}"
    ratio = f"i {s.machine.get(f'{name}.ratio'):.4g}"
    if s.machine.core.kind(name) == "rigid":
        s.arrow(f"motor {n}", f"pinion {n}", ratio)
        return
    _joint(s, n, "gearbox", 13.0, y, ratio)
    s.arrow(f"motor {n}", f"gearbox {n}")
    s.arrow(f"gearbox {n}", f"pinion {n}")


def _mesh(s: _Sketch, n: int, driver: str, y: float) -> None:
    _joint(s, n, "mesh", 15.4, y)
    s.arrow(driver, f"mesh {n}", f"θ_c{n}" if driver.startswith("pinion") else "θ")
    rigid = s.machine.core.kind(f"mesh_{n}") == "rigid"
    ratio = f"i_m {s.machine.get(f'mesh_{n}.ratio'):.4g}"
    s.arrow(f"mesh {n}", "table", f"{ratio}, torque i_m T_c{n}")
    if not rigid:  # what the ring does to the pinion
        s.arrow(f"mesh {n}", driver, f"− T_c{n}", at=y + _aside(y))


def _joint(s: _Sketch, n: int, what: str, x: float, y: float, ratio: str = "") -> None:
    """A connection as a block: with play, or elastic, or rigid."""
    name = f"{what}_{n}"
    kind = s.machine.core.kind(name)
    if kind != "gap":
        give = "" if kind == "rigid" else _stiffness(s, name)
        s.block(f"{what} {n}", _lines(f"{kind} {what}", ratio, give), "box", x, y)
        return
    rotary = s.machine.axis == "rotary"
    play = f"{1e3 * s.machine.get(f'{name}.gap'):.3g} mrad" if rotary else s.words(f"{name}.gap")
    text = _lines(ratio, "backlash", f"± {play}", _stiffness(s, name))
    s.block(f"{what} {n}", text, "gap", x, y)


def _stiffness(s: _Sketch, name: str) -> str:
    return f"K_t {short(s.machine.get(f'{name}.stiffness'))}"


def _feedback(s: _Sketch) -> None:
    """What is measured and where it goes."""
    lowest = min(block.y for block in s.blocks)
    sensor = s.options["position_sensor"]
    if sensor != "motor":
        how = "θ_m, table encoder"
        if sensor == "both":
            how += f", over {s.words('tau_s')}"
        s.arrow("table", "e", how, at=lowest - 1.3, sign="−")
    if sensor != "table":
        s.arrow("motor 1", "e", "θ_1/(i i_m), motor encoder", at=lowest - 1.6, sign="−")
    count = s.options["speed_samples"]
    how = f" from {count} encoder samples" if count else ""
    for n in s.drives:
        y = s.row(n)
        s.arrow(f"motor {n}", f"speed sum {n}", f"ω_c{n}{how}", at=y + 1.05 * _aside(y), sign="−")


def _equaliser(s: _Sketch) -> None:
    """The torque equaliser between the drives, its tension, and which drives it corrects."""
    tension = s.options["tension"]
    integral = bool(s.number("T_E"))
    weight = s.number("w")
    s.block(
        "equaliser",
        _lines(
            f"torque equaliser {'PI' if integral else 'P'}",
            f"g_E {s.words('g_E')}" + (f", T_E {s.words('T_E')}" if integral else ""),
            f"w {weight:g}" if weight != 0.5 else "",
            f"± Ω_E {s.words('Omega_E')}",
            _sampled(s, "tension"),
        ),
        "box", 8.9, 0,
    )  # fmt: skip
    for n in s.drives:
        sign = "+" if n == 1 else "−"
        s.arrow(f"motor {n}", "equaliser", f"T_{n}", at=s.row(n) * 0.14, sign=sign)
        chosen = {"both": True, "master": n == 1, "slave": n > 1}[s.options["equaliser"]]
        if chosen:
            s.arrow("equaliser", f"speed sum {n}", "y", sign="−" if n == 1 else "+")
    if tension != "off":
        filtered = f"filter {s.words('tau_t')}" if s.number("tau_t") else ""
        falling = "falls with load" if tension == "falling" else ""
        text = _lines("tension", s.words("T_ten"), filtered, falling)
        s.block("tension", text, "box", 7.0, 0)
        s.arrow("tension", "equaliser", sign="−")


def _sampled(s: _Sketch, loop: str) -> str:
    """The sample time of a loop that has one."""
    return f"every {s.words(f'{loop}_sample')}" if s.number(f"{loop}_sample") else ""


def _lines(*texts: str) -> str:
    return "\n".join(text for text in texts if text)
