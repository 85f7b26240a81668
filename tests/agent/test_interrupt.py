import signal

import gymnasium
import pytest

from tests.agent.runs import CONTAINER, assert_same, at, at_pick, at_step, crash, interrupt
from unload import TrainConfig, train
from unload.agent.checkpoint import RunFolder
from unload.agent.interrupt import deferred_interrupts


def test_ctrl_c_while_the_environments_are_made(tmp_path, monkeypatch):
    config, make_vec = TrainConfig(**CONTAINER), gymnasium.make_vec
    train(config, tmp_path / "straight", progress=False)

    def interrupted(*arguments, **keywords):
        interrupt()
        return make_vec(*arguments, **keywords)

    monkeypatch.setattr(gymnasium, "make_vec", interrupted)
    message = "stopped after 4 picks; call train again with run_dir="
    with pytest.raises(KeyboardInterrupt, match=message):
        train(config, tmp_path / "broken", progress=False)
    monkeypatch.setattr(gymnasium, "make_vec", make_vec)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_a_second_ctrl_c_stops_at_once(tmp_path):
    config = TrainConfig(**CONTAINER, checkpoint_interval=0)
    train(config, tmp_path / "straight", progress=False)

    def twice() -> None:
        interrupt()
        interrupt()
        pytest.fail("still running")

    with at_pick(7, twice), pytest.raises(KeyboardInterrupt, match="^$"):
        train(config, tmp_path / "broken", progress=False)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_ctrl_c_works_again_after_a_run(tmp_path):
    handler = signal.getsignal(signal.SIGINT)
    train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.parametrize("method", ["finish", "result"])
def test_ctrl_c_in_the_last_moments_is_not_swallowed(tmp_path, method):
    config = TrainConfig(**CONTAINER)
    with at(RunFolder, method, 1, interrupt), pytest.raises(KeyboardInterrupt):
        train(config, tmp_path, progress=False)
    with at_step(1, crash):  # it is finished
        assert len(train(config, tmp_path, progress=False).curve) == 10


def test_a_second_ctrl_c_inside_compiled_code_is_a_keyboard_interrupt():
    """There, the exception raised by the signal comes out as a SystemError."""
    with pytest.raises(KeyboardInterrupt), deferred_interrupts() as received:
        interrupt()
        try:
            interrupt()
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None
    assert len(received) == 2
    with pytest.raises(SystemError), deferred_interrupts():
        raise SystemError("of another reason")
