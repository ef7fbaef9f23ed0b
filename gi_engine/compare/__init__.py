"""GI Engine against Cycles, and integrator against integrator: renders, reference, figures, report. Every render runs in a process of its
own (worker.py, asked by child.py), so that what crashes or hangs there is one line of the report. Leaves out judging: see parity.py."""
