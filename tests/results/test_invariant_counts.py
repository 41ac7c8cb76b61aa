"""Counts of broken invariants over many runs, and what is said of them."""

from itertools import permutations

from merge_cosim.results.invariants import joined, lines

PARTS = (
    {"encounters": 3, "broken": {"speed": 1}, "first": {"speed": "b"}},
    {"encounters": 4, "broken": {"speed": 2, "jump": 1}, "first": {"speed": "a", "jump": "c"}},
    {"encounters": 5, "broken": {}, "first": {}},
)


def test_counts_are_added_in_any_order():
    (total,) = {str(joined(parts)) for parts in permutations(PARTS)}
    total = joined(PARTS)
    assert total["encounters"] == 12
    assert {name: count for name, count in total["broken"].items() if count} == {"speed": 3, "jump": 1}
    assert total["first"] == {"speed": "a", "jump": "c"}
    speed, jump = lines(total)
    assert speed == "broken invariant 'speed' (speeds lie in 0 ... 100 m/s): 3 of 12 encounters, such as a"
    assert jump.endswith("1 of 12 encounters, such as c")
    assert lines(joined(PARTS[2:])) == []
