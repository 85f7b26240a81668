import plotly.graph_objects as go

from unload.load.slider import buttons, slider


def test_plotly_takes_both_and_they_name_the_frames():
    layout = go.Layout(
        sliders=[slider({"0": "no pick", "1": "one pick"})], updatemenus=[buttons(300)]
    )
    steps = layout.sliders[0].steps
    assert [step.label for step in steps] == ["no pick", "one pick"]
    assert [list(step.args[0]) for step in steps] == [["0"], ["1"]]
    play, pause = layout.updatemenus[0].buttons
    assert play.args[0] is None and list(pause.args[0]) == [None]
    assert play.args[1]["frame"]["duration"] == 300 and play.args[1]["fromcurrent"]
