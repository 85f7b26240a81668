"""The experiments of the reproduction, a room for each question, and how their results are kept.

Read ``grid`` first (an experiment of training runs), then ``results`` (what is kept, published and
read), ``statistics`` (how a run ends, and how sure a mean is) and ``style`` (the look of figures).
``changes`` holds what experiments change in a run, ``fingerprint`` says whether the code still
trains as it did, ``exercise`` whether a reader's answer is right. ``__main__`` is the command
line.
"""
