"""The paper's own figures and table, and its numbers beside ours.

``diagrams`` (Figs. 1, 3, 7), ``visible_items`` (4–6). ``tuning`` (8–10) and ``training`` (11 and
12) hold the paper's runs, and what is measured and drawn of them. ``numbers`` compares the paper's
numbers with all this. Figures of a few lines stand in the notebooks that show them.
"""
