"""Curves of runs that are made up for the tests."""

import numpy as np
import pandas as pd


def curve(msr, loss=(0.5, 0.3, 0.5, 0.3)) -> pd.DataFrame:
    """A run of 20 million picks, its MSR and loss straight from one given value to the next."""
    picks = np.arange(1, 626) * 32_000  # of an episode of all environments
    place = np.linspace(0, 1, len(picks))
    columns = {
        name: np.interp(place, np.linspace(0, 1, len(values)), values)
        for name, values in (("success_rate", msr), ("loss", loss))
    }
    return pd.DataFrame({"picks": picks, **columns})


def course(msr, loss) -> pd.DataFrame:
    """A run whose windows of half a million picks have these means."""
    picks = np.arange(1, len(msr) + 1) * 500_000
    return pd.DataFrame({"picks": picks, "success_rate": msr, "loss": loss})
