"""All logged cars around the encounters of a replay."""

from __future__ import annotations

from pathlib import Path

from merge_cosim.ngsim.pairing.recordings import LoggedScene, episode_scenes, site_scenes
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.ngsim.table import SIMULATED
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.scenarios.sources import Pairs


def load_scenes(scenario: Scenario, source: str, data: Path | None) -> dict[str, LoggedScene]:
    """Return the scenes of a replay's sites, by recording.

    Raises:
        UserError: A file is damaged.
    """
    pairs = scenario.encounters
    assert isinstance(pairs, Pairs)
    scenes: dict[str, LoggedScene] = {}
    for name in pairs.sites:
        site = find_site(name)
        own = {}
        if data is not None:
            own = {**episode_scenes(data, site, pairs.rules), **site_scenes(data, site, pairs.rules)}
        if source == "surrogate" and not any(name.startswith(SIMULATED) for name in own):
            own = site_scenes(surrogate_folder(site), site, pairs.rules)
        scenes |= own
    return scenes
