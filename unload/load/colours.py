"""One colour for each meaning, in every picture of a load."""

# Okabe and Ito's colours, which the colour-blind tell apart as well; pale for what does not matter.
COLOURS: dict[str, tuple[float, float, float]] = {
    "unseen": (0.86, 0.86, 0.84),
    "visible": (0.34, 0.71, 0.91),
    "liftable": (0.00, 0.62, 0.45),
    "blocked": (0.84, 0.37, 0.00),
    "tried": (0.94, 0.89, 0.26),
    "failed": (0.80, 0.47, 0.65),
    "on top of it": (0.00, 0.45, 0.70),  # of the chosen box
    "cannot move": (0.74, 0.74, 0.72),
}


def css(colour: tuple[float, float, float]) -> str:
    """Return a colour of three numbers in [0, 1] as CSS and plotly write it."""
    return "rgb({:.0f},{:.0f},{:.0f})".format(*(255 * value for value in colour))
