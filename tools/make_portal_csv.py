"""Write a big CSV in the format of the NGSIM portal, with all its quirks, to time the reader with.

The cars are made up: they follow straight lines at constant speed, and those of lane 7 change into the host lane
halfway, so that there are pairs. What is true to the portal is the format: a byte-order mark, 25 columns, quoted
thousands, four locations, Vehicle_IDs that repeat between periods, cars in no order, and repeated rows.

    python tools/make_portal_csv.py big.csv --rows 12000000
"""

import argparse
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

FRAMES = 600
"""Frames of each car; a multiple of 100 keeps the arithmetic plain."""
PERIODS = (
    ("us-101", 1_118_846_978_900),
    ("us-101", 1_118_847_869_000),
    ("us-101", 1_118_848_769_000),
    ("i-80", 1_113_433_136_100),
    ("i-80", 1_113_436_766_900),
    ("i-80", 1_113_437_666_900),
    ("lankershim", 1_118_935_680_200),
    ("peachtree", 1_163_019_100_000),
)
"""Location and clock origin [ms] of each period; the last two locations only need to be passed over."""
HOST_LANES = {"us-101": 5, "i-80": 6}


def thousands(values: np.ndarray, digits: int) -> pa.Array:
    """Write numbers with `digits` decimals, thousands set apart by a comma and then in quotes."""
    text = pc.cast(pa.array(np.round(values, digits) if digits else values.astype(np.int64)), pa.string())
    for _ in range(4):  # up to 10^12
        text = pc.replace_substring_regex(
            text, pattern=r"(\d)(\d{3})(,|\.|$)", replacement=r"\1,\2\3", max_replacements=1
        )
    big = pc.match_substring(text, ",")
    return pc.if_else(big, pc.binary_join_element_wise('"', text, '"', ""), text)


def cars(location: str, origin: int, ids: np.ndarray, rng: np.random.Generator) -> pa.Table:
    """Make the rows of some cars of one period, car after car."""
    n = len(ids)
    frame = (rng.integers(0, 8_000, n)[:, None] + np.arange(FRAMES)).ravel()
    speed = np.repeat(rng.uniform(20.0, 35.0, n), FRAMES)
    lane = np.repeat(rng.integers(1, 8, n), FRAMES)
    second_half = np.tile(np.arange(FRAMES) >= FRAMES // 2, n)
    lane = np.where((lane == 7) & second_half, HOST_LANES.get(location, 7), lane)
    y = speed * np.tile(np.arange(FRAMES) * 0.1, n)
    zero, nothing = np.zeros(len(y), dtype=np.int8), np.full(len(y), "")
    columns = {
        "Vehicle_ID": thousands(np.repeat(ids, FRAMES), 0),
        "Frame_ID": thousands(frame, 0),
        "Total_Frames": np.full(len(y), FRAMES),
        "Global_Time": thousands(origin + 100 * frame, 0),
        "Local_X": thousands(lane * 12.0 - 6.0, 3),
        "Local_Y": thousands(y, 3),
        "Global_X": thousands(6_451_137.641 + y, 3),
        "Global_Y": thousands(1_873_344.962 - y, 3),
        "v_length": thousands(np.repeat(rng.uniform(12, 20, n), FRAMES), 1),
        "v_Width": thousands(np.repeat(rng.uniform(5, 8, n), FRAMES), 1),
        "v_Class": zero + 2,
        "v_Vel": thousands(speed, 2),
        "v_Acc": zero,
        "Lane_ID": lane,
        **dict.fromkeys(("O_Zone", "D_Zone", "Int_ID", "Section_ID", "Direction", "Movement"), nothing),
        "Preceding": zero,
        "Following": zero,
        "Space_Headway": np.full(len(y), 73.21),
        "Time_Headway": np.full(len(y), 2.05),
        "Location": np.full(len(y), location),
    }
    return pa.table(columns)


def lines(table: pa.Table) -> bytes:
    """Write rows as they stand in the portal's file."""
    texts = [pc.cast(column, pa.string()) for column in table.columns]
    return ("\n".join(pc.binary_join_element_wise(*texts, ",").to_pylist()) + "\n").encode()


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--rows", type=int, default=12_000_000)
    parser.add_argument("--repeated", type=int, default=1000, help="rows that are written twice")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    at_once = 50
    groups = max(1, round(arguments.rows / FRAMES / at_once))
    ids = [rng.permutation(np.arange(1, groups // len(PERIODS) * at_once + at_once + 1)) for _ in PERIODS]
    with arguments.out.open("wb") as file:
        for group in range(groups):
            period, turn = group % len(PERIODS), group // len(PERIODS)
            table = cars(*PERIODS[period], ids[period][turn * at_once : (turn + 1) * at_once], rng)
            if group == 0:
                file.write(b"\xef\xbb\xbf" + ",".join(table.column_names).encode() + b"\n")
            order = rng.permutation(table.num_rows)
            again = rng.choice(order, -(-arguments.repeated // groups))
            file.write(lines(table.take(pa.array(np.concatenate([order, again])))))


if __name__ == "__main__":
    main()
