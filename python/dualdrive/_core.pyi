"""The C++ core of dualdrive."""

from collections.abc import Mapping, Sequence
import enum
from typing import Annotated, Any, Final

import numpy
import numpy.typing
from numpy.typing import NDArray


__sundials_version__: str

__kernels__: str

class Waveform:
    """
    An input signal over time: polynomial pieces plus harmonics. Immutable.

    A commanded motion is an angle of the table in rad (a position in m on a linear axis); times are in s.
    Build one with the functions beside this class; add signals with +, scale them with *.
    """

    def __init__(self, knots: numpy.typing.ArrayLike, pieces: numpy.typing.ArrayLike) -> None:
        """
        Polynomial pieces.

        knots: shape (n,), increasing, s. pieces: shape (n + 1, degree + 1), degree at most 5: row 0 before the first
        knot, row k from knot k - 1 to knot k, the last row from the last knot on; coefficients of rising powers of the
        time since the piece's own first knot (row 0: since the first knot).
        Raises ValueError naming index, value and rule.
        """

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, state: tuple[Any, ...], /) -> None: ...

    def value(self, times: numpy.typing.ArrayLike) -> Any:
        """
        The signal at times in s: a float for a float, else an array of the same shape.

        At a breakpoint the value is that of the side which follows it.
        """

    def rate(self, times: numpy.typing.ArrayLike) -> Any:
        """Its first derivative, per s; shapes as for value()."""

    def acceleration(self, times: numpy.typing.ArrayLike) -> Any:
        """Its second derivative, per s^2; shapes as for value()."""

    def breaks(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Times in s, increasing, where value, rate or acceleration jumps; shape (n,).
        """

    def knots(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Times in s, increasing, where the formula changes, smoothly or not; shape (n,).
        """

    def end(self) -> float:
        """
        The time in s from which the signal rests; infinite if it never does, 0 for a constant.
        """

    def __add__(self, arg: Waveform, /) -> Waveform: ...

    def __mul__(self, factor: float) -> Waveform: ...

    def __rmul__(self, factor: float) -> Waveform: ...

def constant(value: float) -> Waveform:
    """The same value at all times."""

def step(height: float, at: float = 0.0) -> Waveform:
    """Zero before `at` (s), `height` from there on."""

def ramp(rate: float, start: float = 0.0, end: float = float('inf')) -> Waveform:
    """
    Zero before `start` (s), rising by `rate` per s until `end`, then held. Raises ValueError unless end > start.
    """

def sine(amplitude: float, frequency_hz: float, phase: float = 0.0, offset: float = 0.0, start: float = 0.0) -> Waveform:
    """
    offset + amplitude sin(2 pi f (t - start) + phase) from `start` (s) on, before it the offset alone.

    phase in rad. Raises ValueError unless frequency_hz > 0 and all numbers are finite.
    """

def sum(waveforms: Sequence[Waveform]) -> Waveform:
    """The sum of a list of signals; of none: zero."""

def scale(waveform: Waveform, factor: float) -> Waveform:
    """The signal times a number."""

def shift(waveform: Waveform, delay: float) -> Waveform:
    """The same signal, later by `delay` s."""

def multisine(amplitudes: numpy.typing.ArrayLike, frequencies_hz: numpy.typing.ArrayLike, phases: numpy.typing.ArrayLike, start: float = 0.0) -> Waveform:
    """
    Sum of amplitudes[k] sin(2 pi frequencies_hz[k] (t - start) + phases[k]) from `start` (s) on, zero before.

    Three lists of one length >= 1, phases in rad. Raises ValueError naming argument, value and rule.
    """

class Phases(enum.Enum):
    """How the lines of a multisine stand to each other."""

    random = 0
    """uniform, from the seed; the same on every computer"""

    schroeder = 1
    """a low peak for the same RMS value"""

def odd_multisine(rms: float, base_frequency_hz: float, lines: int, seed: int = 0, phases: Phases = Phases.random, start: float = 0.0, from_zero: bool = False) -> Waveform:
    """
    A flat multisine on `lines` odd harmonics f, 3f, 5f, ... of the base frequency, with the given RMS value.

    What a machine answers at even harmonics is then its even nonlinearity. The signal begins with its own value at
    `start` (s); from_zero subtracts that value, so that a commanded position does not jump.
    Raises ValueError unless rms, base_frequency_hz and lines are positive.
    """

def jerk_limited_move(distance: float, speed: float, acceleration: float, jerk: float, start: float = 0.0, from_: float = 0.0) -> Waveform:
    """
    The fastest move from rest at `from_` to rest at `from_ + distance`, beginning at `start` (s).

    distance in rad at the table (or m), of either sign; limits speed, acceleration and jerk positive, in rad/s,
    rad/s^2, rad/s^3; jerk = inf gives a trapezoid of speed. Short moves reach less than the limits.
    Raises ValueError naming argument, value and rule. Source: Biagiotti & Melchiorri 2008, section 3.4.
    """

def cycle_of_moves(targets: numpy.typing.ArrayLike, speed: float, acceleration: float, jerk: float, dwell: float = 0.0, start: float = 0.0, repeats: int = 1, from_: float = 0.0) -> Waveform:
    """
    Moves from `from_` to each target in turn, a dwell (s) after each, all `repeats` times.

    targets: shape (n,), rad at the table (or m); limits as for jerk_limited_move. Ends with the last dwell.
    Raises ValueError naming argument, value and rule.
    """

def dwells_of_cycle(targets: numpy.typing.ArrayLike, speed: float, acceleration: float, jerk: float, dwell: float = 0.0, start: float = 0.0, repeats: int = 1, from_: float = 0.0) -> numpy.typing.NDArray[numpy.float64]:
    """
    When that cycle stands at its targets: shape (moves, 3), columns target, begin (s), end (s).

    Arguments and errors as for cycle_of_moves.
    """

def bidirectional_targets(positions: numpy.typing.ArrayLike, overrun: float) -> numpy.typing.NDArray[numpy.float64]:
    """
    Targets of one bidirectional cycle after ISO 230-2, for cycle_of_moves.

    Below the first position by `overrun` > 0, up through all, beyond the last by `overrun`, down through all.
    positions: shape (n,), n >= 2, increasing; the result has shape (2 n + 2,). Raises ValueError.
    """

class Interpolation(enum.Enum):
    """What a recorded signal does between its samples."""

    hold = 0
    """the last sample's value"""

    linear = 1
    """straight lines"""

    cubic = 2
    """a not-a-knot spline with continuous acceleration"""

def sampled(times: numpy.typing.ArrayLike, values: numpy.typing.ArrayLike, interpolation: Interpolation = ...) -> Waveform:
    """
    A recorded signal through `values` at increasing `times` (s), even or not; shapes (n,), n >= 2 (hold: 1).

    Before the first and after the last sample the end values are held. Each change of value (hold) or of slope
    (linear) is a break, where a solver stops; cubic has none but its ends, and overshoots at steps.
    Raises ValueError naming argument, index, value and rule.
    """

class Parameter:
    """
    One declared number of a machine: path, unit (SI), bounds, default, doc, value.
    """

    @property
    def path(self) -> str: ...

    @property
    def unit(self) -> str: ...

    @property
    def doc(self) -> str: ...

    @property
    def low(self) -> float: ...

    @property
    def high(self) -> float: ...

    @property
    def low_excluded(self) -> bool:
        """True where the lower bound itself is not allowed."""

    @property
    def standard(self) -> float:
        """The default."""

    @property
    def typical(self) -> float:
        """A usual size: prior width, step scale."""

    @property
    def value(self) -> float: ...

    @property
    def counted(self) -> bool:
        """Counted, chosen or read off: not fitted unless it is named."""

class HypothesisText:
    """What an effect means where it may be what a machine lacks."""

    @property
    def called(self) -> str:
        """As engineers call it; empty where that is its name."""

    @property
    def untried(self) -> str:
        """Why no search puts it in; empty where one does."""

    @property
    def places(self) -> str:
        """
        Where a search puts it in, comma-separated; empty: at all its usual places.
        """

    @property
    def contains(self) -> str:
        """
        Simpler laws that it is at a limit of its numbers, comma-separated, the nearest first.
        """

    @property
    def carrier(self) -> str:
        """
        What multiplies its harmonics: torque of the drive, direction of motion, or nothing.
        """

    @property
    def modulates(self) -> str:
        """Number of its body of which its wave is a fraction; empty: of none."""

    @property
    def lowest_order(self) -> float:
        """Below it a harmonic is another law's."""

    @property
    def friction(self) -> bool:
        """Friction beside the laws of dry friction."""

    @property
    def causes(self) -> bool:
        """Whether every number is a cause of its own."""

    @property
    def clips(self) -> bool:
        """Whether a signal that stands at an extreme may be its doing."""

    @property
    def scales(self) -> bool:
        """
        Whether it is, in a torque balance, a factor of all inertias and frictions.
        """

class EffectType:
    """A physical effect of the registry: what can be added to a machine."""

    @property
    def name(self) -> str: ...

    @property
    def equation(self) -> str: ...

    @property
    def source(self) -> str: ...

    @property
    def validity(self) -> str: ...

    @property
    def confused_with(self) -> str: ...

    @property
    def brings(self) -> str: ...

    @property
    def places(self) -> str: ...

    @property
    def hypothesis(self) -> HypothesisText: ...

    @property
    def by_load(self) -> bool:
        """Whether it needs the torque of a mesh."""

    @property
    def invertible(self) -> bool:
        """Whether the motion follows from what such a sensor says."""

    @property
    def affine(self) -> bool: ...

    @property
    def acts_on(self) -> str: ...

    @property
    def memory(self) -> int:
        """How many states of its own it brings: bristles that bend, for one."""

    @property
    def structural(self) -> bool:
        """
        Whether it is a part of the machine, its parameters one value with that part's.
        """

    @property
    def in_balance(self) -> bool:
        """Whether a torque balance on recorded motion contains it."""

    @property
    def parameters(self) -> list[Parameter]: ...

def effect_types() -> list[EffectType]:
    """Every registered effect, in registry order."""

def user_laws() -> list[EffectType]:
    """
    Effects whose law a user writes without a compiler, in a machine file: expression and spline.
    """

def formula_unit(formula: str, units: Mapping[str, str]) -> str:
    """
    The unit of a formula whose names have these units (name -> SI unit; rad counts as a number).

    Raises ValueError naming the part of the formula whose units contradict each other.
    """

def formula_names(formula: str) -> list[str]:
    """
    The names a formula reads. Raises ValueError naming column and rule where it can't be read.
    """

def effect_type(name: str) -> EffectType:
    """
    The effect of that name, users' laws included.

    Raises ValueError naming the nearest known effects.
    """

def eased(x: Sequence[float]) -> NDArray[numpy.float64]:
    """
    How a load sets in, from 0 to 1: S of the law cutting_torque, at each of these parts of its rise.
    """

class Machine:
    """
    A machine as an assembly: bodies, connections, motors, a controller, effects.

    Every number has a stable path (mesh_1.gap, table.J, controller.K_v) in SI units; tie groups (meshes.gap)
    reach all members. Eq. 22 and Eq. 23 of the source paper is one instance. Raises ValueError naming part, value, rule.
    """

    def __init__(self) -> None: ...

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, state: tuple[Any, ...], /) -> None: ...

    @property
    def name(self) -> str: ...

    @name.setter
    def name(self, arg: str, /) -> None: ...

    def copy(self) -> Machine:
        """An independent copy."""

    def __copy__(self) -> Machine: ...

    def __deepcopy__(self, memo: object) -> Machine: ...

    def add_body(self, name: str, locked: bool = False) -> None:
        """Add a body with parameters J and b."""

    def connect(self, name: str, driver: str, driven: str, kind: str = 'gap', frame: str = 'driver') -> None:
        """
        Join two bodies: rigid, compliant or gap. frame says in whose angle twist, stiffness and gap are given.
        """

    def add_motor(self, name: str, body: str = '', kind: str = 'armature') -> None:
        """Put a motor on a body (default: the body of the same name)."""

    def set_controller(self, kind: str = 'master_slave', equaliser: str = 'both', tension: str = 'constant', current: str = 'cascade', speed_samples: int = 0, position_sensor: str = 'table') -> None:
        """
        Choose the controller's structure; its numbers are parameters controller.*.

        equaliser: both, slave or master gets the correction. tension: constant, falling with the load, off. current: cascade, or
        voltage for a drive without current loop. speed_samples n: speed from the mean of the last n encoder samples, differenced. position_sensor: the position loop is closed on the table's encoder, the master motor's, or both.
        """

    @property
    def controller_options(self) -> dict[str, Any]: ...

    @staticmethod
    def choices() -> dict[str, list[str]]:
        """What each choice may be set to."""

    def add_effect(self, name: str, place: str) -> str:
        """
        Add an effect at a place or group of places; returns its label, the prefix of its parameters.
        """

    def add_expression(self, place: str, formula: str, parameters: Sequence[tuple[str, str, float]] = [], columns: Sequence[tuple[str, str]] = []) -> str:
        """
        Add a user's formula as a torque on a body. parameters: (name, unit, value); columns: recorded ones that it
        reads, (name, unit).
        """

    def add_spline(self, place: str, axes: Sequence[tuple[str, float, float, int, bool]], values: Sequence[float], size: float = 300.0, columns: Sequence[tuple[str, str]] = []) -> str:
        """
        Add a learned curve as a torque on a body, N m, over one coordinate or two; returns its label.

        axes: (coordinate, low, high, knots, periodic); a coordinate is t, angle, speed, a signal, or in.NAME of a
        recorded column. values: at the knots, the last axis first. size: usual size of a value. Raises ValueError.
        """

    def remove_effect(self, label: str) -> None: ...

    @property
    def effects(self) -> list[dict[str, Any]]: ...

    def get(self, path: str) -> float:
        """The value at a path, or that all members of a group agree on."""

    def set(self, path: str, value: float) -> None:
        """Set a value (SI) by path or group; checks bounds."""

    def parameter(self, path: str) -> Parameter: ...

    def members(self, path: str) -> list[str]:
        """The paths that a path or tie group stands for."""

    def parameters(self) -> list[Parameter]:
        """Every parameter with its declaration and value."""

    def unread(self, path: str) -> str:
        """
        Why no law reads the number at a path, the gap of a rigid mesh say; empty where one does.
        """

    @property
    def bodies(self) -> list[str]: ...

    @property
    def connections(self) -> list[str]: ...

    @property
    def motors(self) -> list[str]: ...

    def kind(self, name: str) -> str: ...

    def validate(self) -> None:
        """Check what no single parameter shows. Raises ValueError."""

    def states(self) -> list[tuple[str, str]]:
        """Names and units of the state vector."""

    def signals(self) -> list[tuple[str, str, str]]:
        """(name, unit, long name) of every signal a run can record."""

class Trajectory:
    """
    What a simulation leaves. Arrays have one row per output time; units are SI.
    """

    @property
    def t(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Output times in s, shape (n,)."""

    @property
    def names(self) -> list[str]: ...

    @property
    def units(self) -> list[str]: ...

    @property
    def long_names(self) -> list[str]: ...

    @property
    def values(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Signals, shape (n, signals)."""

    @property
    def elements(self) -> list[str]:
        """Switching elements: meshes, dry friction, limiters, signs of formulas."""

    @property
    def modes(self) -> Annotated[NDArray[numpy.int8], dict(writable=False)]:
        """Modes, shape (n, elements), int8."""

    @property
    def events(self) -> list[tuple[float, str, str, str]]:
        """(time, element, from, to) of every located switch."""

    @property
    def parameters(self) -> list[str]:
        """Of the sensitivities."""

    @property
    def sensitivities(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """d signal / d parameter, shape (n, signals, parameters)."""

    @property
    def gradient_parameters(self) -> list[str]:
        """Of pull_back."""

    def pull_back(self, seeds: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
        """
        d cost / d parameter, shape (gradient_parameters,), from d cost / d value, shape (n, signals). Raises ValueError for another shape, and for a run without gradient or one that stopped early.
        """

    @property
    def work(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """
        Energy put in since the start by each path of work_names, J, shape (n, 7); dissipation is negative.
        """

    work_names: Final[list[str]] = ...
    """(arg: object, /) -> list[str]"""

    @property
    def state_names(self) -> list[str]: ...

    @property
    def final_state(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]: ...

    @property
    def status(self) -> str: ...

    @property
    def message(self) -> str:
        """What went wrong and what to try; empty on success."""

    @property
    def statistics(self) -> dict[str, Any]: ...

def simulate(machine: Machine, inputs: Mapping[str, Waveform], *, end: float, start: float = 0.0, output_step: float = 0.001, times: Sequence[float] = [], engine: str = 'auto', rtol: float = 1e-10, method: str = 'auto', long_double: bool = False, longest_step: float = 0.0, max_steps: int = 50000000, signals: Sequence[str] = [], sensitivities: Sequence[str] = [], gradient: Sequence[str] = [], initial: Mapping[str, float] = {}, energy: bool = True) -> Trajectory:
    """
    Integrate a machine with every switch located.

    inputs: name -> Waveform (theta_ref, T_load, U_n or T_n of an uncontrolled machine, columns a formula reads). Times in s.
    sensitivities: parameter paths or groups, or initial.<state>. gradient: the same, for Trajectory.pull_back. initial: state -> value, others 0. The GIL is released.
    Raises ValueError for input that makes no sense, KeyboardInterrupt on Ctrl-C; a failed integration is a status.
    """

def recorded_channels(machine: Machine) -> list[str]:
    """
    Channels that effects of this machine sit at, outside the loop: sensor_delay@theta_1 and its like.
    """

def recorder_delay(machine: Machine, channel: str, parameters: Sequence[str] = []) -> tuple[float, NDArray[numpy.float64]]:
    """
    How late the recorder of a channel is, s, and its derivatives by these parameter paths, shape (parameters,).
    """

def record(machine: Machine, channel: str, t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], signal: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], parameters: Sequence[str] = []) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
    """
    What the recorder of a channel writes down of its signal, late as it is.

    Returns (values, d value / d signal, d value / d parameter), shapes (n,), (n,), (n, parameters). Raises ValueError.
    """

def delay_of(machine: Machine, label: str) -> float:
    """
    By how much an effect makes a reading late, s. Raises ValueError for an unknown label.
    """

def taken_back(machine: Machine, label: str, angle: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], speed: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], acceleration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
    """
    The motion (rad, rad/s, rad/s^2, shape (n,) each) that stood at the sensor of an effect when it said this.

    Of effects whose type is invertible; a delay is left out. Raises ValueError where a reading belongs to more than one angle.
    """

def torque_balance(machine: Machine, channels: Mapping[str, Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]], parameters: Sequence[str] = [], standstill: float = 0.0) -> dict[str, Any]:
    """
    Evaluate the machine's laws on recorded motion, against recorded motor torque.

    channels: t, theta_*, omega_*, alpha_* per body, T_n per motor, all SI and of one length. Returns a dict: equations (names;
    'total' first), residual (eq, rows) = J alpha + losses - motor torque, jacobian (eq, rows, parameters), standstill (eq, rows)
    1 where dry friction is set-valued (table speed below `standstill`), effects (effects, rows). Raises ValueError.
    """

class Scenario:
    """
    What a machine of an ensemble is put through, and what of it is summed up.
    """

    def __init__(self, inputs: Mapping[str, Waveform], *, end: float, start: float = 0.0, engine: str = 'auto', rtol: float = 1e-10, method: str = 'auto', longest_step: float = 0.0, max_steps: int = 50000000, initial: Mapping[str, float] = {}, energy: bool = True, reductions: Sequence[tuple[str, str, float, float]] = []) -> None:
        """
        Inputs and options as of simulate. reductions: (signal, measure, begin, end), times in s, both included;
        measures: min, max, range, peak, mean, rms, final. Raises ValueError for an unknown measure or method.
        """

class EnsembleRun:
    """What one run of an ensemble leaves."""

    @property
    def number(self) -> int: ...

    @property
    def status(self) -> str:
        """Of the trajectory, or 'refused'."""

    @property
    def message(self) -> str:
        """What went wrong and what to try; empty on success."""

    @property
    def method(self) -> str:
        """Of the solver."""

    @property
    def numbers(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """
        Reductions, reversals of every connection, tallies; NaN unless the run succeeded.
        """

    def signals(self, count: int) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """
        The `count` signals kept, shape (count, times); NaN from where the run failed.
        """

class Ensemble:
    """Many runs of one machine on many threads, in bounded memory."""

    def __init__(self, machine: Machine, scenarios: Sequence[Scenario], *, paths: Sequence[str], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], signals: Sequence[str] = [], threads: int = 1, ordered: bool = False) -> None:
        """
        scenarios: one for all runs, or one for each. paths: parameters, tie groups or initial.<state>; values, SI,
        shape (runs, paths). times in s. signals: kept whole. The first runs begin at once. Raises ValueError.
        """

    def take(self, into: list[EnsembleRun], patience: float = 0.05) -> None:
        """
        Append what has finished, as soon as it is a batch or `patience`, s, ends; with `ordered` in order of
        numbers. The GIL is released.
        """

    @property
    def done(self) -> bool:
        """Whether everything that will ever come was taken."""

    def stop(self) -> None:
        """Begin no more runs; those under way are finished and handed over."""

    def close(self) -> None:
        """Cut the runs under way short and end the threads."""

    tallies: Final[list[str]] = ...
    """(arg: object, /) -> list[str]"""

def reduce(t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], x: Annotated[NDArray[numpy.float64], dict(shape=(None,), device='cpu', writable=False)], windows: Sequence[tuple[str, float, float]]) -> list[float]:
    """
    Sum up a signal x, shape (n,), at increasing times t: one number per (measure, begin, end), as a Scenario does.
    Raises ValueError.
    """

def count_flanks(switches: Sequence[tuple[str, str]]) -> tuple[int, int]:
    """
    (contacts, reversals) of one connection's switches in order, each (mode before, mode after).
    """

class LinearSystem:
    """
    A machine while its modes are frozen: dz/dt = A z + a, signals = C z + c; SI.
    """

    @property
    def states(self) -> list[str]: ...

    @property
    def signals(self) -> list[str]: ...

    @property
    def A(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Shape (states, states)."""

    @property
    def a(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Shape (states,)."""

    @property
    def C(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Shape (signals, states)."""

    @property
    def c(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Shape (signals,)."""

def linearise(machine: Machine, inputs: Mapping[str, Waveform] = {}, *, modes: Mapping[str, str] = {}, state: Mapping[str, float] = {}, t: float = 0.0) -> LinearSystem:
    """
    The machine as a linear system in given modes: exact where it is affine, else the tangent at `state`.

    modes: element -> mode by name, as events report them ({'mesh_1': 'front'}); others are gap, stuck, linear, positive.
    state: state -> value, others 0. Delays are left out. Raises ValueError for a name the machine does not have.
    """

class FrozenLaws:
    """Rates of the states and guards of the switches at one instant; SI."""

    @property
    def rates(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """Shape (states,)."""

    @property
    def guards(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """
        Shape (2 x switching elements,): positive while the element's mode lasts.
        """

    @property
    def guard_slopes(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]:
        """
        Their derivatives along the flow, 1/s; empty where the model itself was asked.
        """

def frozen_laws(machine: Machine, inputs: Mapping[str, Waveform] = {}, *, modes: Mapping[str, str] = {}, state: Mapping[str, float] = {}, t: float = 0.0, cell: tuple[float, float] = (float('-inf'), float('inf')), matrices: bool = False) -> FrozenLaws:
    """
    The laws of given modes, from the model or from the matrices that engines use where a machine is affine.

    t, cell: s, the instant and the interval between knots of the inputs in which it lies.
    Other arguments and errors are those of linearise.
    """

def possible_modes(machine: Machine, inputs: Mapping[str, Waveform] = {}) -> dict[str, list[str]]:
    """Switching element -> the modes that it may have, by name."""

class SampledRecord:
    """
    A stretch of a record, made ready to be predicted sample by sample.

    inputs: name -> Waveform. times: s, shape (n,), increasing. channels: (signal of the machine, places whose effects change its reading). measured: SI, shape (n, channels).
    Raises ValueError for lengths that differ and times that do not increase.
    """

    def __init__(self, inputs: Mapping[str, Waveform], times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], channels: Sequence[tuple[str, Sequence[str]]], measured: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def starts(self) -> list[int]:
        """Samples at which a stretch begins."""

    @property
    def samples(self) -> int:
        """How many."""

    def stretches(self, which: Sequence[tuple[int, int]]) -> SampledRecord:
        """
        Stretches of it, (first sample, how many), end to end; sampled loops tick as in the whole one.

        Raises ValueError for none, for fewer than two samples in one, or beyond the end.
        """

    @property
    def step(self) -> float:
        """Median distance of the times, s."""

class KalmanGains:
    """
    Kalman gains of a machine: the steady ones where all meshes carry, nothing rests and no limit is met, and what was learned along a record.
    """

    def copy(self) -> KalmanGains: ...

    def begin_as(self, other: KalmanGains) -> None:
        """Take over how another's stretches begin, and its steady gains."""

    def alike(self, other: KalmanGains) -> bool:
        """
        Whether these are the gains of the other's machine bit by bit, as far as both are known.
        """

    @property
    def phases(self) -> int:
        """
        Samples after which the ticks of sampled loops repeat; each has gains of its own.
        """

    def K(self, phase: int = 0) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]:
        """
        The steady gain, shape (states + disturbances + channels, again where of order two, again where zeros drift; channels).
        """

    def whitening(self, phase: int = 0) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]:
        """Its S^(-1/2), lower triangular, shape (channels, channels)."""

    def log_det(self, phase: int = 0) -> float:
        """Its log det S."""

    @property
    def learned(self) -> int:
        """
        Stays in one pattern of modes (what carries, what rests, which limits are met) whose gains were learned.
        """

def kalman_gains(machine: Machine, record: SampledRecord, sensors: Sequence[tuple[float, float, float]], torque: Mapping[str, tuple[float, float]], speed: float = 0.0, drifts: Sequence[tuple[float, float]] = [], first_torque: Mapping[str, tuple[float, float]] = {}, first_deviation: Mapping[str, float] = {}, second: Sequence[float] = [], creep: Mapping[str, tuple[float, float]] = {}) -> KalmanGains:
    """
    Kalman gains: the steady ones where all meshes carry; `predict` learns the others along a record.

    sensors: (drive, memory, white) per channel: n' = memory n + drive w, and a white part. torque: body -> (drive, memory) of a torque of unknown course, constant over a sample, d' = memory d + drive w, N*m. speed: table speed, rad/s, about which laws that are not affine are linearised. drifts: (drive, memory) per channel of a zero that drifts, or none. What is not known of the first state is where torques like first_torque (those of torque unless told) would take it, and first_deviation besides, state -> standard deviation. second: per channel, the second partial autocorrelation of its noise, none for order one; memory is the first. creep: body -> (drive, memory) of its speed while dry friction holds it, rad/s. Raises ValueError.
    """

def linear_filter(machine: Machine, record: SampledRecord, gains: KalmanGains) -> tuple[list[Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')]], Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='F')], int]:
    """
    (F by phase, C, states of the machine) of x' = F (x + K e), y = C x + e: its tangent where all meshes carry, nothing rests and no limit is met, with torques of unknown course and what sensors remember behind its own states. Raises ValueError.
    """

def held_by_friction(machine: Machine) -> list[str]:
    """Bodies that dry friction may hold, one of each that turn together."""

def predict(machine: Machine, record: SampledRecord, gains: KalmanGains, *, initial: Sequence[Mapping[str, float]] = [], offsets: Sequence[float] = [], substeps: int = 1, given: int = 0, states: bool = False, learn: bool = False) -> dict[str, Any]:
    """
    Replay a record, the state corrected at every sample.

    initial: per stretch, state -> value at its first sample, others 0. offsets: per channel, what its sensor adds. substeps: per sample, where a law is not affine. given: first samples of a stretch that the likelihood is conditioned on, whose residuals are 0. states: also trajectory, corrections (n, states), torques of unknown course (n, bodies), innovations (n, channels) and pattern (n,), bit c of which says whether connection c carries. learn: keep in `gains` what it lacks of this record; else that is worked out again each time.
    Returns a dict: residuals (n, channels), whitened; log_det; finite; switches. The GIL is released. Raises ValueError.
    """

def has_sensitivities(machine: Machine, record: SampledRecord) -> bool:
    """
    Whether first-order changes of a replay can be told: no law of the machine that is not affine, no delay, and ticks of sampled loops that repeat within a few samples.
    """

def sensitivities(machine: Machine, record: SampledRecord, gains: KalmanGains, neighbours: Sequence[tuple[Machine, Sequence[Mapping[str, float]], Sequence[float]]], *, initial: Sequence[Mapping[str, float]] = [], offsets: Sequence[float] = [], given: int = 0, most_apart: float = 1.0, at_any_cost: bool = False) -> list[NDArray[numpy.float64] | None]:
    """
    How whitened innovations change, to first order, where neighbours of a machine take its place.

    neighbours: (machine, initial, offsets) of each; most_apart: share of the changes of modes that may come more than a sample before or after in one; at_any_cost: also where replays cost less; all else as in `predict`. Returns for each an array (n, channels), None where that can't be told (`has_sensitivities`), of neighbours with other states or switches, and of those apart too often. The GIL is released. Raises ValueError.
    """

__version__: str
