"""The paper's own figures and table, and its numbers beside ours.

``diagrams`` (Figs. 1, 7), ``loads`` (2, 3), ``observation`` (4–6). ``tuning`` (8–10) and
``training`` (11 and 12) hold the paper's runs and what is measured of them, ``figures`` draws both.
``animation`` is the README's moving picture. ``numbers`` and ``curves`` compare the paper's numbers
with all this.
"""
