"""The experiments of the reproduction, one file each, and how their results are kept.

Read ``results`` first, then ``observation``, ``tuning`` and ``training`` (the paper's own);
``measure``, ``study``, ``random_picks``, ``random_share``, ``drift``, ``answer``,
``trained``, ``changes``, ``interventions``, ``values``, ``verdict``, ``survival``, ``mistakes``,
``questions``, ``value_questions`` and ``cell_texts`` (why 60 %);
``comparison`` and ``robustness`` (policies compared); ``lifts``, ``full_lifts`` and ``agreement``
(the physics); ``paper_numbers`` and ``paper_curves`` (the paper compared with all this). ``fingerprint`` says whether the code still
trains as it did, ``intervals`` how sure a mean is, ``resampling`` how far few runs mislead,
``exercise`` whether a reader's answer is right.
``__main__`` is the command line, and ``figures`` draws.
"""
