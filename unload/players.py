"""The policies that are compared with one another."""

from pathlib import Path

from unload import checks, files, policies
from unload.agent import load_policy
from unload.evaluate import Policy

SIMPLE = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
LEARNED = ("paper", "recommended")
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
