import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.sites import I80, US101, site


def test_sites_are_found_by_name_and_by_the_portals_spelling():
    assert site("us101") is US101
    assert site("US-101") is US101
    assert site("i80") is I80


def test_an_unknown_site_names_the_choices():
    with pytest.raises(UserError, match="unknown site 'a9': choose us101 or i80"):
        site("a9")
