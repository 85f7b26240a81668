import numpy as np

from studies.play.canvas import ABSENT, Canvas


def test_boxes_and_labels_are_those_of_the_load(full_load):
    canvas = Canvas(full_load)
    corners = np.frombuffer(canvas.boxes, np.float32).reshape(-1, 2, 3)
    assert np.allclose(corners.mean(axis=1), full_load.positions, atol=1e-5)
    assert np.allclose(np.ptp(corners, axis=1), full_load.sizes, atol=1e-5)
    x, y, z = np.rint(full_load.sizes[7] * 1000).astype(int)
    assert canvas.labels[7] == f"item 7, package {full_load.packages[7]}: {x} × {y} × {z} mm"


def test_a_pick_is_one_small_message(full_load, monkeypatch):
    canvas = Canvas(full_load)
    sent = []
    monkeypatch.setattr(canvas, "send_state", lambda key=None: sent.append(key))
    numbers = np.zeros(len(full_load), int)
    numbers[3] = ABSENT
    canvas.show(numbers, {"visible": (0, 0.5, 1)}, {"on it": np.array([5])}, (3, 0.46, (0, 1, 0)))
    assert len(sent) == 1 and "boxes" not in sent[0] and "labels" not in sent[0]
    assert canvas.colours[3] == ABSENT and len(canvas.colours) == len(full_load)
    assert canvas.outlined == [5]
    assert [line[0] for line in canvas.legend] == ["visible", "on it"]


def test_the_same_lift_twice_is_seen_twice(small_load):
    canvas = Canvas(small_load)
    seen = []
    canvas.observe(lambda change: seen.append(change["new"]["number"]), "lift")
    for _ in range(2):
        canvas.show(np.zeros(len(small_load)), {}, {}, (3, 0.46, (0, 1, 0)))
    assert seen == [1, 2]
