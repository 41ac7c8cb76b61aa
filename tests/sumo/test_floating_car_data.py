"""Where SUMO says that cars are, as a table."""

from pathlib import Path

import numpy as np

from merge_cosim.sumo.floating_car_data import read_floating_cars

WRITTEN = """<fcd-export>
<timestep time="0.00"/>
<timestep time="0.10">
<vehicle id="one" x="1.5" y="-2" angle="90" type="car" speed="3" pos="7.5" lane="in_0" slope="0"/>
<vehicle id="two" x="0" y="4" angle="0" type="truck" speed="3" pos="2" lane="in_1" slope="0"/>
</timestep>
</fcd-export>
"""


def test_a_row_per_car_and_step_with_the_heading_from_the_x_axis(tmp_path: Path) -> None:
    (tmp_path / "fcd.xml").write_text(WRITTEN)
    rows = read_floating_cars(tmp_path / "fcd.xml")
    assert rows.columns.tolist() == ["time_s", "car", "type", "lane", "pos_m", "x_m", "y_m", "heading"]
    assert rows.iloc[0].tolist() == [0.1, "one", "car", "in_0", 7.5, 1.5, -2.0, 0.0]  # east
    assert rows.iloc[1].tolist() == [0.1, "two", "truck", "in_1", 2.0, 0.0, 4.0, np.pi / 2]  # north
