"""How little tension is enough, and what more of it costs: heat against accuracy, at corner cases.

from dualdrive import Machine
from dualdrive.optimise import least_tension, optimise

machine = Machine.load("heavy-table-550t")
print(least_tension(machine))
print(optimise(machine).table())
"""

from dualdrive.optimise.duty import duty_cycle
from dualdrive.optimise.errors import OptimiseError
from dualdrive.optimise.front import ACCURACY, Front, non_dominated, optimise
from dualdrive.optimise.objective import TENSION, Design, evaluate
from dualdrive.optimise.tension import LeastTension, least_tension
from dualdrive.optimise.worst_case import Corner, corners

__all__ = [
    "ACCURACY",
    "TENSION",
    "Corner",
    "Design",
    "Front",
    "LeastTension",
    "OptimiseError",
    "corners",
    "duty_cycle",
    "evaluate",
    "least_tension",
    "non_dominated",
    "optimise",
]
