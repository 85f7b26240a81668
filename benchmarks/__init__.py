"""How fast the parts are. ``python benchmarks/run.py`` measures and prints it all."""
