"""Mistakes of a caller, each of which a type checker finds: ``make lint`` wants every ignore used.

Nothing runs this file.
"""

import numpy as np

import unload
from unload.physics.local import LocalPhysics

load = unload.read_load()
rng = np.random.default_rng()
unload.read_laod()  # type: ignore[attr-defined]
unload.policies.highst(np.ones((1, 128, 3)), np.ones((1, 128)), rng)  # type: ignore[attr-defined]
unload.picking_order("boxes.csv")  # type: ignore[arg-type]
unload.picking_order(load, polcy="highest")  # type: ignore[call-arg]
unload.picking_order(load, by=3)  # type: ignore[arg-type]
unload.evaluate("highest")  # type: ignore[arg-type]
unload.evaluate(unload.policies.random, episode=5)  # type: ignore[call-arg]
unload.evaluate(unload.policies.random, physics="tabel")  # type: ignore[arg-type]
unload.ContainerEnv(physics="locall")  # type: ignore[arg-type]
unload.Load(load.positions, load.sizes, wall=load.walls)  # type: ignore[call-arg]
unload.TrainConfig(pick=3)  # type: ignore[call-arg]
unload.TrainConfig(picks="many")  # type: ignore[arg-type]
unload.train(unload.TrainConfig(), 3)  # type: ignore[arg-type]

# These are none.
unload.evaluate(unload.policies.random, 5, physics=LocalPhysics(), ties="average")
unload.picking_order(load, by="stop")
