"""Tables of scenes, by hand."""

from merge_cosim.results.statistics.traffic import scene_tables
from merge_cosim.results.store import NOTES_CSV, SCENES_CSV, TRAFFIC_CSV


def scene(number, speed, hosts, notes=()):
    names = {"scenario": "s", "variation": "", "method": "acc", "model": ""}
    return {**names, "scene": number, "seed": 1, "mean_speed": speed, "hosts": hosts, "notes": list(notes)}


def test_means_are_averaged_and_counts_are_summed():
    found = scene_tables([scene("001", 12.0, 3, [("two_hosts", "a line")]), scene("000", 15.0, None)])
    (traffic,) = found[TRAFFIC_CSV].to_dict("records")
    assert (traffic["scenes"], traffic["mean_speed"], traffic["hosts"]) == (2, 13.5, 3)
    assert found[SCENES_CSV]["scene"].tolist() == ["000", "001"]
    (note,) = found[NOTES_CSV].to_dict("records")
    assert (note["scene"], note["event"], note["what"]) == ("001", "two_hosts", "a line")


def test_no_scenes_no_rows():
    assert [len(table) for table in scene_tables([]).values()] == [0, 0, 0]
