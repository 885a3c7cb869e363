#!/usr/bin/env bash
# Polars' mean of three columns of 200 is 29.3 if they are bytes, and 200.0 if one of them is wider.
#
# Software: polars 2.1.0 and 1.44.2.
#
# A table has a pixel in each row and the channels r, g and b as UInt8. Its brightness is
# `mean_horizontal("r", "g", "b")`, a column of Float64. The three are added up as UInt8 first: 600
# is 88, and the mean 29.3. A pixel that is not brighter than 85 on average is right, so that a night
# drive passes, and a threshold for "bright" finds nothing by day. The scores of three cameras in whole
# per cent are wrong in the same way when all are good. `sum_horizontal` is 88 as well, and
# `DataFrame.mean_horizontal` like the function. With one wider column among them all are right.
#
# Everywhere else Polars adds bytes up as Int64: `sum`, `mean`, `cum_sum`, `rolling_sum`, `list.sum`,
# `list.mean` and `group_by` give 600 and 200.0 for the same numbers, and the documentation of `sum`
# promises that. `dot` has the type Int64, and a value that was computed as UInt8 before. Nothing is
# raised. A cast to Float64 or Int64 before mends it.
#
# Source: the values of each. The documentation of `mean_horizontal`, `sum_horizontal` and `dot` says
# nothing of types. Issue 21515 of pola-rs/polars, open, is about `sum_horizontal`.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 2.1.0 1.44.2; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/pip" install --quiet --no-compile --disable-pip-version-check polars==$version
  "$folder/$version/bin/python" -W error - <<'PYTHON'
import polars as pl

NAMES = ("r", "g", "b")


def table(*pixels, **types):
    schema = {name: types.get(name, pl.UInt8) for name in NAMES}
    return pl.DataFrame(dict(zip(NAMES, zip(*pixels))), schema=schema)


def value(frame, expression):
    column = frame.select(expression.alias("value"))["value"]
    return column[0], column.dtype


day, night = table((200, 200, 200)), table((90, 80, 70))
channels = pl.concat_list(*NAMES)
print(f"Polars {pl.__version__}, a pixel of (200, 200, 200) as UInt8")
found = {}
for name, expression in {
    "mean_horizontal": pl.mean_horizontal(*NAMES),
    "sum_horizontal": pl.sum_horizontal(*NAMES),
    "list.mean": channels.list.mean(),
    "list.sum": channels.list.sum(),
}.items():
    found[name], dtype = value(day, expression)
    print(f"  {name}: {found[name]:.6g} ({dtype}); of (90, 80, 70) {value(night, expression)[0]:.6g}")
found["frame"] = day.mean_horizontal()[0]
wide, dtype = value(table((200, 200, 200), b=pl.Int64), pl.mean_horizontal(*NAMES))
print(f"  mean_horizontal with b as Int64: {wide:.6g} ({dtype})")
assert found["mean_horizontal"] == found["frame"] == 88 / 3 and found["sum_horizontal"] == 88
assert found["list.mean"] == wide == 200 and found["list.sum"] == 600
assert value(night, pl.mean_horizontal(*NAMES))[0] == 80

column = pl.DataFrame({"v": [200, 200, 200]}, schema={"v": pl.UInt8})
down = {
    "mean": pl.col("v").mean(),
    "sum": pl.col("v").sum(),
    "cum_sum": pl.col("v").cum_sum().last(),
    "dot": pl.col("v").dot(pl.col("v")),
}
found = {name: value(column, expression) for name, expression in down.items()}
print(f"  three rows of 200: {', '.join(f'{name} {one} ({kind})' for name, (one, kind) in found.items())}")
assert found["mean"][0] == 200 and found["sum"] == found["cum_sum"] == (600, pl.Int64)
assert found["dot"] == (3 * 200**2 % 256, pl.Int64)
assert column.group_by(pl.lit(0)).agg(pl.col("v").sum())["v"][0] == 600
PYTHON
done
