"""A heavy table moves: following error, torques, which flanks carried."""

import numpy as np

import dualdrive

machine = dualdrive.Machine.load("heavy-table-550t")
motion = dualdrive.motion.move(0.02, v=0.03, a=0.01, j=0.05, start=2.0, end=14.0)
run = dualdrive.simulate(machine, motion)

arcsec = np.rad2deg(1) * 3600
print(f"{run.status}: {len(run.events)} switches")
print(f"peak following error {np.abs(run['e']).max() * arcsec:.1f} arcsec")
print(f"motor torques {run['T_1'].min():.0f} .. {run['T_1'].max():.0f} N·m (drive 1)")

# Without tension the play is free, and the table hunts at standstill.
slack = machine.copy()
slack.set("controller.T_ten", 0)
hunting = dualdrive.simulate(slack, motion)
still = hunting.t > 12.0
print(f"hunting without tension: {np.ptp(hunting['e'][still]) * arcsec:.1f} arcsec peak to peak")
