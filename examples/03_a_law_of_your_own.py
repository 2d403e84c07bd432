"""A torque written as a formula, without a compiler: wind on a dish, its gusts recorded."""

import numpy as np

import dualdrive
from dualdrive import _core

machine = dualdrive.Machine.load("bench")
machine.core.add_expression(
    "table", "-c * (speed + gust) * abs(speed + gust)", [("c", "N*m*s^2", 0.02)]
)
t = np.linspace(0.0, 4.0, 401)
gust = _core.sampled(t, 0.5 * np.sin(3.0 * t), _core.Interpolation.cubic)
run = dualdrive.simulate(machine, dualdrive.motion.sine(0.1, f=0.5), end=4.0, inputs={"gust": gust})
print(f"{run.status}: wind torque up to {np.abs(run['expression@table']).max() * 1e3:.2f} mN·m")
