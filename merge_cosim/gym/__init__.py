"""Gymnasium environments: `import merge_cosim.gym` registers `merge_cosim/Merge-v0`.

The package `gymnasium` is needed: `pip install merge-cosim[gym]`.
"""

try:
    import gymnasium
except ImportError as error:
    raise ImportError("merge_cosim.gym needs Gymnasium: pip install 'merge-cosim[gym]'") from error

from merge_cosim.controllers.policy import save_policy
from merge_cosim.gym.settings import Options, Reward

NAME = "merge_cosim/Merge-v0"
"""Name of the environment for `gymnasium.make` and `gymnasium.make_vec`."""

gymnasium.register(
    NAME,
    entry_point="merge_cosim.gym.env:MergeEnv",
    vector_entry_point="merge_cosim.gym.vector:MergeVectorEnv",
)

__all__ = ["NAME", "Options", "Reward", "save_policy"]
