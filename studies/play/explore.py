"""A figure under sliders and switches, as a Jupyter widget."""

import base64
import io
from collections.abc import Callable
from html import escape
from pathlib import Path

import anywidget
import ipywidgets as widgets
import matplotlib.pyplot as plt
import traitlets
from matplotlib.figure import Figure

from studies.style import STYLE, styled


class Picture(anywidget.AnyWidget):
    """A PNG. ``on_msg`` hears of clicks: ``{"x", "y"}``, in shares of it from the upper left."""

    _esm = Path(__file__).with_name("picture.js")
    value = traitlets.Bytes().tag(sync=True)


class Explore(widgets.VBox):
    """A figure that is drawn anew whenever one of its controls has changed.

    Where no kernel runs, the figure of the first settings stands in its place.

    Args:
        draw: is called with the values of the controls, by their names, and returns a figure
            of Matplotlib. What it says in words, such as in a title, must hold for all of them.
        click: is called with x and y of a click, in the coordinates of the figure's first axes.
            It returns new values of controls, by their names, or says in a sentence why none
            changes. Without it the figure cannot be clicked.
        controls: name → widget with a ``value``, such as ``ipywidgets.FloatSlider``.

    Attributes:
        picture: the figure as it is drawn now.
    """

    _figure: Figure

    def __init__(
        self,
        draw: Callable[..., Figure],
        click: Callable[[float, float], dict | str] | None = None,
        **controls: widgets.ValueWidget,
    ) -> None:
        self._draw, self._controls, self._clickable = styled(draw), controls, click is not None
        self.picture: widgets.DOMWidget
        if click is None:
            self.picture = widgets.Image(format="png", layout={"max_width": "100%"})
        else:
            self.picture = Picture()
            self.picture.on_msg(lambda _, place, __: self._tell(click(*self._in_axes(**place))))
        for control in controls.values():
            control.style.description_width = "initial"  # as wide as the text
            if control.has_trait("continuous_update"):
                control.continuous_update = False  # of a slider: draw when it is let go
                name = 7 * len(control.description)  # pixels; its value takes 80
                control.layout.width = f"{250 + 80 + name}px"
            control.observe(lambda _: self._show(), "value")
        wrapped = {"flex_flow": "row wrap", "width": "100%"}
        row = widgets.HBox(list(controls.values()), layout=wrapped)
        self._busy = widgets.HTML()
        # Not stretched to the width of the page, which would blur the picture.
        aligned = {"align_items": "flex-start"}
        super().__init__([row, self._busy, self.picture], layout=aligned)
        self._show()

    def _show(self) -> None:
        self._busy.value = "computing …"
        values = {name: control.value for name, control in self._controls.items()}
        try:
            self._figure, content = self._draw(**values), io.BytesIO()
        except Exception as error:  # which Jupyter keeps for its log
            self._busy.value = escape(f"{type(error).__name__}: {error}")
            raise
        # Margins stay where the picture is clicked, so that its shares are those of the figure.
        whole = {"savefig.bbox": "standard"} if self._clickable else {}
        with plt.style.context([STYLE, whole]):
            self._figure.savefig(content, dpi="figure", format="png", metadata={"Software": None})
        plt.close(self._figure)  # so that no notebook shows it once more
        self.picture.value, self._busy.value = content.getvalue(), ""

    def _in_axes(self, x: float, y: float) -> tuple[float, float]:
        """A place of the picture in the coordinates of the figure's first axes."""
        pixels = self._figure.transFigure.transform((x, 1 - y))
        x, y = self._figure.axes[0].transData.inverted().transform(pixels).tolist()
        return x, y

    def _tell(self, chosen: dict | str) -> None:
        """Set the controls that a click has chosen, or say why there are none."""
        if isinstance(chosen, str):
            self._busy.value = chosen
        else:
            for name, value in chosen.items():
                self._controls[name].value = value

    def _repr_mimebundle_(self, **kwargs) -> dict:
        """The widget, and what is shown of it where no kernel runs."""
        still = base64.b64encode(self.picture.value).decode()
        return {"image/png": still} | super()._repr_mimebundle_(**kwargs)
