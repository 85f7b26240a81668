"""What Stable-Baselines3's DQN needs to train our network; ``unload.env.sb3`` has the rest."""

from stable_baselines3.dqn.policies import DQNPolicy, QNetwork

from unload.network.peq import PEQNetwork


class PEQValues(QNetwork):
    """``PEQNetwork`` where Stable-Baselines3 expects a network; n is ``net_arch[0]``."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.q_net = PEQNetwork(self.net_arch[0])

    def forward(self, obs):
        return self.q_net(obs)


class PEQPolicy(DQNPolicy):
    """Stable-Baselines3's DQN policy with the paper's network; ``net_arch=[n]``."""

    def make_q_net(self) -> PEQValues:
        arguments = self._update_features_extractor(self.net_args, features_extractor=None)
        return PEQValues(**arguments).to(self.device)
