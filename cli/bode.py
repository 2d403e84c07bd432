"""dualdrive bode: frequency responses of loops and drives, computed, simulated and measured."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from dualdrive import linear
from dualdrive.files import write_atomically
from dualdrive.machine import Machine
from dualdrive.memory import excess
from dualdrive.units import parse, parse_values
from dualdrive_cli._files import OUTPUT, PICTURE, Reads
from dualdrive_cli._shared import analysis, console, load, write_json

_BYTES_OF_ONE = 2000.0  # of a frequency: the matrices of its response, and points of its curves


@click.command(
    epilog="Example: dualdrive bode heavy-table-250t --open-loop position --plot loop.png",
)
@click.option("--input", "source", default="theta_ref", show_default=True, help="Or T_load, "
              "torque@BODY, Omega_1, Omega_2*, T_1*, U_1, ...")  # fmt: skip
@click.option("--output", default="theta_m", show_default=True, help="A signal of a run.")
@click.option("--open-loop", metavar="BLOCK", help="The gain around a loop instead, with margins: "
              "position, equaliser, speed_1, current_1, ...")  # fmt: skip
@click.option("--drives", is_flag=True, help="Both drives' speed loops instead, and whether they "
              "differ.")  # fmt: skip
@click.option("--poles", is_flag=True, help="Poles of Eq. 23 in its nine contact modes instead.")
@click.option("--modes", help='Flanks, such as "(1, -1)"; default: those that tension closes.')
@click.option("--cut", multiple=True, metavar="BLOCK", help="Open this loop; repeatable.")
@click.option("--friction", type=click.Choice(["forward", "backward", "stuck"]), default="forward",
              show_default=True, help="What dry friction does meanwhile.")  # fmt: skip
@click.option("--other", type=click.Choice(["held", "open"]), default="held", show_default=True,
              help="With --drives: the drive that is not measured.")  # fmt: skip
@click.option("--frequencies", metavar="LIST", help="Hz, as start:stop:count (spaced evenly in "
              "logarithm) or a,b,c.")  # fmt: skip
@click.option("--simulate", "amplitude", metavar="AMPLITUDE", help="Measure on the nonlinear "
              "machine besides, with sines of this size, e.g. 20arcsec.")  # fmt: skip
@click.option("--speed", default="0", show_default=True, help="Steady speed of the table while "
              "simulating, so that friction slides.")  # fmt: skip
@click.option("--measured", "files", multiple=True, type=Reads(), metavar="CSV", help="Overlay a "
              "measured response: frequency, magnitude, phase; repeatable.")  # fmt: skip
@click.option("-o", "--output-file", "output_file", type=OUTPUT, help="Write the response as CSV.")
@click.option("--plot", type=PICTURE, help="Draw the Bode plot into a picture.")
@analysis
def command(
    machine: str,
    settings: tuple[str, ...],
    source: str,
    output: str,
    open_loop: str | None,
    drives: bool,
    poles: bool,
    modes: str | None,
    cut: tuple[str, ...],
    friction: str,
    other: str,
    frequencies: str | None,
    amplitude: str | None,
    speed: str,
    files: tuple[Path, ...],
    output_file: Path | None,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Compute frequency responses of a machine with its controller, around one state of its flanks.

    Small signals: the machine is linearised with its flanks as they are, delays exact, sampled
    loops approximated, and this is said. --simulate drives the machine with all its switches.
    """
    _refuse_two(open_loop, drives, poles)
    m = load(machine, settings)
    f = _frequencies(frequencies)
    turning = parse(speed, m.unit_of("omega_m", "rad/s"), key="--speed")
    if poles:
        _poles(m, json_to)
        return
    if drives:
        _drives(m, f, modes, other, plot, json_to)
        return
    if open_loop:
        first = linear.open_loop(m, open_loop, f, modes=modes, friction=friction)
    else:
        opened = ("position",) if amplitude and source == "Omega_1" else cut  # as it is simulated
        first = linear.frequency_response(
            m, source, output, f, modes=modes, cut=opened, friction=friction
        )
    found = [first]
    if amplitude:
        if open_loop or cut:
            rule = "measures --input to --output with the loops closed (Omega_1: position open)"
            raise ValueError(f"--simulate: {rule}; leave --open-loop and --cut out")
        found.append(_simulated(m, first, amplitude, turning, frequencies is not None))
    found += [linear.read_response(path, input=first.input, output=first.output) for path in files]
    margins = first.margins() if open_loop else None
    if plot:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.bode(*found, margins=margins).savefig(temporary)
    if output_file:
        linear.write_response(found[min(1, len(found) - 1)] if amplitude else first, output_file,
                              overwrite=overwrite)  # fmt: skip
    _report(found, margins, json_to, [p for p in (output_file, plot) if p])


def _refuse_two(*what: object) -> None:
    if sum(map(bool, what)) > 1:
        raise ValueError("--open-loop, --drives, --poles: each is a question of its own; give one")


def _frequencies(text: str | None) -> Any:
    """Frequencies in Hz; a range is spaced evenly in logarithm."""
    if text is None:
        return None
    if text.count(":") != 2:
        return sorted(parse_values(text, "Hz", key="--frequencies").tolist())
    start, stop, count = text.split(":")
    low, high = (parse(part, "Hz", key="--frequencies") for part in (start, stop))
    if not (0 < low < high and re.fullmatch("[0-9]{1,18}", count) and int(count) > 1):
        raise ValueError(f"--frequencies {text}: needs 0 < start < stop and a count above 1")
    if too_much := excess(_BYTES_OF_ONE * int(count)):
        raise ValueError(f"--frequencies {text}: {too_much}; give a smaller count")
    return linear.spaced(low, high, int(count))


def _simulated(
    m: Machine, model: linear.FrequencyResponse, size: str, speed: float, as_given: bool
) -> linear.FrequencyResponse:
    """The same question put to the nonlinear machine, at 25 frequencies unless they were given."""
    from rich.progress import Progress

    f = model.frequency_hz if as_given else linear.worth_measuring(model)
    unit = {"theta_ref": "rad", "Omega_1": "rad/s"}.get(model.input, "N*m")
    name = {"theta_ref": "theta_ref", "Omega_1": "Omega_1"}.get(model.input, "T_load")
    amplitude = parse(size, m.unit_of(name, unit), key="--simulate")
    with Progress(console=console(err=True), transient=True) as bar:
        task = bar.add_task("simulating", total=len(f))
        return linear.stepped_sine(
            m, model.input, model.output, f, amplitude, speed=speed,
            progress=lambda done, _: bar.update(task, completed=done),
        )  # fmt: skip


def _drives(
    m: Machine, f: Any, modes: str | None, other: str, plot: Path | None, json_to: str | None
) -> None:
    found = linear.compare_drives(m, f, modes=modes, other=other)
    if plot:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.drives(found).savefig(temporary)
    write_json(json_to, found.figures())
    if json_to != "-":
        click.echo(found.text)
        if plot:
            click.echo(f"written: {plot}")


def _poles(m: Machine, json_to: str | None) -> None:
    found = linear.modes(m)
    write_json(
        json_to,
        {
            name: {
                "A": mode.A.tolist(), "B": mode.B.tolist(), "C": mode.C.tolist(),
                "v": mode.v.tolist(), "offset": mode.offset.tolist(), "states": mode.states,
                "eigenvalues": [[p.real, p.imag] for p in mode.eigenvalues.tolist()],
            }
            for name, mode in found.items()
        },
    )  # fmt: skip
    if json_to == "-":
        return
    table = Table("flanks", "poles of A' [1/s]: real ± imaginary", box=None, pad_edge=False)
    for name, mode in found.items():
        shown = [p for p in mode.eigenvalues.tolist() if p.imag >= 0]
        table.add_row(name, ", ".join(_pole(p) for p in shown))
    console().print(table)


def _pole(p: complex) -> str:
    if abs(p) < 1e-4:
        return "0"
    return f"{p.real:.4g} ± {p.imag:.4g}" if p.imag else f"{p.real:.4g}"


def _report(
    found: list[linear.FrequencyResponse],
    margins: linear.Margins | None,
    json_to: str | None,
    written: list[Path],
) -> None:
    content: dict[str, Any] = {"responses": [response.figures() for response in found]}
    if margins is not None:
        content["margins"] = {**vars(margins), "text": margins.text}
    write_json(json_to, content)
    if json_to == "-":
        return
    first = found[0]
    table = Table.grid(padding=(0, 2))
    if margins is None:
        table.add_row("response", f"{first.output} / {first.input} {first.unit}".rstrip())
    else:
        table.add_row("open loop", f"around {first.input}")
    table.add_row("with", first.note)
    table.add_row("frequencies", f"{first.frequency_hz.size} from {first.frequency_hz[0]:.3g} Hz "
                  f"to {first.frequency_hz[-1]:.3g} Hz")  # fmt: skip
    if margins is not None:
        table.add_row("margins", margins.text)
    else:
        f, size = first.peak()
        table.add_row("peak", f"{size:.2f} dB at {f:.4g} Hz")
        if first.unit == "" and (width := first.bandwidth_hz()) is not None:
            table.add_row("bandwidth", f"{width:.4g} Hz, at -3 dB")
        if not first.stable:
            table.add_row("stable", "NO: this machine is unstable with these flanks and loops")
    for response in found[1:]:
        table.add_row(response.origin, _apart(first, response))
    for path in written:
        table.add_row("written", str(path))
    console().print(table)


def _apart(model: linear.FrequencyResponse, other: linear.FrequencyResponse) -> str:
    """How far another response is from the model's."""
    try:
        found = linear.differ(model, other)
    except linear.LinearError as error:
        return str(error)
    k = int(abs(found.difference_db).argmax())
    text = (f"{other.note}: at most {abs(found.difference_db[k]):.3g} dB from the model, at "
            f"{found.master.frequency_hz[k]:.3g} Hz")  # fmt: skip
    if other.distortion is not None:
        text += f"; harmonics up to {100 * other.distortion.max():.2g} %"
    return text
