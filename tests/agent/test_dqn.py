import numpy as np
import pytest
import torch
from torch.nn.functional import smooth_l1_loss

from tests.agent.runs import make_batch, peq, weights, without_next
from unload import DQN, Greedy, plain
from unload.agent.learner import ROWS_PER_PASS, PlainLearner
from unload.fast.learner import FusedLearner


@pytest.mark.parametrize("gamma", [0.0, 0.9])
@pytest.mark.parametrize("fused", [False, True])
def test_an_update_is_that_of_the_page(rng, gamma, fused):
    """Of a batch that takes more than one pass, from rows of a larger memory.

    The target network is a copy, also after it has followed once: learners change weights in place.
    """
    batch = make_batch(rng)
    assert len(batch["actions"]) > ROWS_PER_PASS
    agent = DQN(peq(), learning_rate=0.01, gamma=gamma, fused_update=fused)
    assert type(agent.learner) is (FusedLearner if fused else PlainLearner)
    reference, target = peq(), peq()
    optimizer = torch.optim.Adam(reference.parameters(), lr=0.01)
    given = batch if gamma else without_next(batch)
    memory = {name: np.concatenate([array[:7], array]) for name, array in given.items()}
    for number in range(3):
        if number == 1:
            agent.update_target()
            target.load_state_dict(reference.state_dict())
        loss = plain.update(reference, target, optimizer, [*zip(*batch.values())], gamma)
        assert agent.update(memory, np.arange(7, 157)) == pytest.approx(loss, rel=1e-5)
        for mine, theirs in zip(agent.network.parameters(), reference.parameters()):
            # Adam hides a constant factor of the gradients; the fused ones are not kept.
            assert fused or torch.allclose(mine.grad, theirs.grad, rtol=1e-4, atol=1e-6)
    for mine, theirs in zip(weights(agent.network), weights(reference)):
        assert torch.allclose(mine, theirs, atol=2e-5)


@pytest.mark.parametrize("fused", [False, True])
def test_beta_is_where_the_loss_becomes_linear(rng, fused):
    batch = without_next(make_batch(rng))
    values = peq()(torch.from_numpy(batch["observations"]))
    chosen = values.gather(1, torch.from_numpy(batch["actions"])[:, None])[:, 0]
    loss = smooth_l1_loss(chosen, torch.from_numpy(batch["rewards"]), beta=0.3)
    assert DQN(peq(), beta=0.3, fused_update=fused).update(batch) == pytest.approx(loss.item())


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("name", ["observations", "rewards"])
def test_a_loss_that_is_not_finite_leaves_the_weights(rng, fused, name):
    batch = without_next(make_batch(rng))
    agent = DQN(peq(), fused_update=fused)
    agent.update(batch)
    before = weights(agent.network)
    broken = batch | {name: batch[name].copy()}
    broken[name][0] = np.nan  # of the chosen item too, whatever it is
    with pytest.raises(FloatingPointError, match="the loss is nan.*expected"):
        agent.update(broken)
    assert all(torch.equal(a, b) for a, b in zip(weights(agent.network), before))
    torch.nn.init.constant_(agent.network.scorer.bias, torch.inf)
    with pytest.raises(FloatingPointError, match="scorer.bias is not finite; expected"):
        agent.check_finite()


def test_gradients_that_are_not_finite_leave_the_weights(rng):
    """The loss alone does not tell: the slope of a square root at 0 is infinite."""

    class Root(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.weight = torch.nn.Parameter(torch.zeros(3))

        def forward(self, observations):
            return torch.sqrt(observations.abs() @ self.weight)

    agent = DQN(Root())
    with pytest.raises(FloatingPointError, match="gradient of weight is not finite"):
        agent.update(without_next(make_batch(rng)))
    agent.check_finite()


def test_what_is_no_network_setting_or_batch_is_refused(rng):
    for kind in (DQN, lambda network: Greedy(network, equalize=False)):
        with pytest.raises(TypeError, match="network is None; expected a torch.nn.Module"):
            kind(None)
    for name in ("gamma", "beta", "learning_rate", "fused_update"):
        with pytest.raises((TypeError, ValueError), match=f"{name} is -0.5; expected"):
            DQN(peq(), **{name: -0.5})
    with pytest.raises(ValueError, match="batch has no next_masks, next_observations"):
        DQN(peq(), gamma=0.9).update(without_next(make_batch(rng)))
    observations = make_batch(rng)["observations"]
    for given in ((observations[..., :2], np.ones((150, 20))), (observations, np.ones((150, 19)))):
        with pytest.raises(ValueError, match="has shape"):
            DQN(peq()).choose(*given, 0.0, rng)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("actions", np.full(150, 20), "actions holds 20 to 20; expected 0 to 19"),
        ("actions", np.zeros(150, np.int32), "actions is .* dtype int32; expected int64"),
        ("rewards", np.zeros(149, np.float32), "rewards has shape"),
        ("observations", np.zeros((150, 20, 2), np.float32), "observations has shape"),
        ("rows", np.array([0, 150]), "rows holds 0 to 150; expected 0 to 149"),
        ("rows", np.zeros(0, int), "rows is empty"),
    ],
)
def test_a_batch_that_does_not_fit_is_refused(rng, fused, name, value, message):
    """Compiled code would read past its end."""
    batch = without_next(make_batch(rng)) | {"rows": None, name: value}
    with pytest.raises((TypeError, ValueError), match=message):
        DQN(peq(), fused_update=fused).update(batch, batch.pop("rows"))


def test_a_next_state_without_a_choice_is_refused(rng):
    """Its loss was once infinite."""
    batch, agent = make_batch(rng), DQN(peq(), gamma=0.9)
    for name in ("next_observations", "next_masks", "terminations"):
        for wrong in (batch[name][:-1], batch[name].astype(np.int8)):
            with pytest.raises((TypeError, ValueError), match=f"{name} (has shape|is .* int8)"):
                agent.update(batch | {name: wrong})
    batch["next_masks"][7] = False
    batch["terminations"][7] = True
    agent.update(batch)
    batch["terminations"][7] = False
    with pytest.raises(ValueError, match="next_masks is all zero in row 7, which is not terminal"):
        agent.update(batch)
