"""Benchmarks of `pedestal bench`: speed of the graph, of the compiled laws and of bags on this machine.

Each benchmark is a module. Its function run() prints a table and returns the rows of the table.
"""

BENCH_MODULES = {'graph': 'lockstep', 'core': 'core', 'bag': 'recording'}  # {name on the command line: module}
