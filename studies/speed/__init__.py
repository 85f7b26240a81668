"""How fast the parts are, and how much the tests notice.

``run`` measures and prints all speeds: those of ``parts`` and of whole ``training``. ``mutants``
changes the code in small ways and counts what the tests notice.
"""
