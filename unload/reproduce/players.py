"""The policies that are compared with one another."""

from hashlib import blake2b
from pathlib import Path

from unload.agent import policies
from unload.agent.evaluation import Policy
from unload.agent.weights import load_policy
from unload.support import checks, files

SIMPLE = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Trainings of the paper's configuration end in two ways: one of each plays.
LEARNED = ("paper", "paper_seed_2", "recommended")
POLICIES = (*SIMPLE, *LEARNED)


def policy_file(name: str, folder: str | Path = files.DATA) -> Path:
    """Where a learned policy is kept: ``folder/policies/<name>.safetensors``.

    Raises:
        FileNotFoundError: it is absent; the message names it.
    """
    checks.one_of("name", name, LEARNED)
    path = Path(folder) / "policies" / f"{name}.safetensors"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is absent; expected the policy {name!r} there")
    return path


def find_policy(name: str, folder: str | Path = files.DATA) -> Policy:
    """One of ``POLICIES`` by its name.

    Raises:
        ValueError: another name.
        FileNotFoundError: see ``policy_file``.
    """
    checks.one_of("name", name, POLICIES)
    return SIMPLE[name] if name in SIMPLE else load_policy(policy_file(name, folder))


def policy_digest(name: str, folder: str | Path = files.DATA) -> str | None:
    """What tells one learned policy of this name from another; None for a simple policy.

    Raises:
        ValueError, FileNotFoundError: as ``find_policy`` does.
    """
    checks.one_of("name", name, POLICIES)
    if name in SIMPLE:
        return None
    return blake2b(policy_file(name, folder).read_bytes(), digest_size=16).hexdigest()
