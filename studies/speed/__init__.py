"""How fast the parts are. ``python -m studies.speed.run`` measures and prints it all."""
