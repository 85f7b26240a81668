"""A figure under sliders and switches, as a Jupyter widget."""

import base64
import io
from collections.abc import Callable

import ipywidgets as widgets
import matplotlib.pyplot as plt

from studies.style import STYLE, styled


class Explore(widgets.VBox):
    """A figure that is drawn anew whenever one of its controls has changed.

    Where no kernel runs, the figure of the first settings stands in its place.

    Args:
        draw: is called with the values of the controls, by their names, and returns a figure
            of Matplotlib. What it says in words, such as in a title, must hold for all of them.
        controls: name → widget with a ``value``, such as ``ipywidgets.FloatSlider``.

    Attributes:
        picture: the figure as it is drawn now.
    """

    def __init__(self, draw: Callable, **controls: widgets.ValueWidget) -> None:
        self._draw, self._controls = styled(draw), controls
        self.picture = widgets.Image(format="png", layout={"max_width": "100%"})
        for control in controls.values():
            control.style.description_width = "initial"  # as wide as the text
            if control.has_trait("continuous_update"):
                control.continuous_update = False  # of a slider: draw when it is let go
                name = 7 * len(control.description)  # pixels; its value takes 80
                control.layout.width = f"{250 + 80 + name}px"
            control.observe(lambda _: self._show(), "value")
        row = widgets.HBox(list(controls.values()), layout={"flex_flow": "row wrap"})
        self._busy = widgets.HTML()
        super().__init__([row, self._busy, self.picture])
        self._show()

    def _show(self) -> None:
        self._busy.value = "computing …"
        values = {name: control.value for name, control in self._controls.items()}
        figure, content = self._draw(**values), io.BytesIO()
        with plt.style.context(STYLE):
            figure.savefig(content, dpi="figure", format="png", metadata={"Software": None})
        plt.close(figure)  # so that no notebook shows it once more
        self.picture.value, self._busy.value = content.getvalue(), ""

    def _repr_mimebundle_(self, **kwargs) -> dict:
        """The widget, and what is shown of it where no kernel runs."""
        still = base64.b64encode(self.picture.value).decode()
        return {"image/png": still} | super()._repr_mimebundle_(**kwargs)
