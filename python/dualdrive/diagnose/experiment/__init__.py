"""The next experiment: what to measure so that two explanations part.

from dualdrive.diagnose.experiment import next_experiment

best = next_experiment(
    [("coulomb@table", a), ("coulomb@motors", b)],
    noise={"theta_m": 1e-6, "I_1": 0.3, "I_2": 0.3},
    channels=["theta_m", "I_1", "I_2"],
)
print(best.motion, best.settings, best.expected_distance)
"""

from __future__ import annotations

from dualdrive.diagnose.experiment.catalogue import LEFT_OUT, Item, menu
from dualdrive.diagnose.experiment.choice import next_experiment
from dualdrive.diagnose.experiment.limits import Limits
from dualdrive.diagnose.experiment.plan import TELLS_APART

__all__ = ["LEFT_OUT", "TELLS_APART", "Item", "Limits", "menu", "next_experiment"]
