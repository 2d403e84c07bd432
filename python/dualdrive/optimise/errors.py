"""What goes wrong with an optimisation."""

from __future__ import annotations

from dualdrive.assembly import gaps
from dualdrive.machine import Machine

__all__ = ["OptimiseError", "refuse_all_but_two_drives"]


class OptimiseError(ValueError):
    """An optimisation that can't be done; the message is one line and says what to do."""


def refuse_all_but_two_drives(machine: Machine) -> None:
    """Tension needs two motors under one master/slave controller. Raises OptimiseError."""
    core = machine.core
    options = core.controller_options
    if len(core.motors) != 2 or options["kind"] != "master_slave":
        raise OptimiseError(
            f"{machine.name}: motors = {', '.join(core.motors) or 'none'}: tension acts between "
            "two motors under a master/slave controller; choose drive_train = dual_servo"
        )
    for name in gaps(core):
        if not core.get(f"{name}.gap") > 0.0:
            raise OptimiseError(
                f"{machine.name}: {name}.gap = 0: tension has no play to close; give it some, or "
                f"set {name}.kind = compliant"
            )
    if options["tension"] != "constant":
        raise OptimiseError(
            f"{machine.name}: controller.tension = {options['tension']}: must be constant for its "
            "size to be sought; --set controller.tension=constant"
        )
