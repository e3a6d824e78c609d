#!/usr/bin/env python3
"""Makes vlbi/src/earth/ut1_utc.txt from the IERS series EOP 20 C04.

    python3 ut1_utc.py eopc04.1962-now > ut1_utc.txt

The series is published by the IERS Earth Orientation Centre at the Paris Observatory (the file
also comes with the Python package astropy-iers-data). Its columns are year, month, day, hour, MJD,
pole x and y, UT1 - UTC in seconds, and more that is not used here.
"""
import sys

FIRST = 51179  # 1 January 1999

values = {}
for line in open(sys.argv[1]):
    cells = line.split()
    if line.startswith("#") or len(cells) < 8:
        continue
    values[int(float(cells[4]))] = round(float(cells[7]) * 1e6)

last = FIRST
while last in values:
    last += 1
print("# UT1 - UTC at 0 h UTC, from the series EOP 20 C04 of the International Earth Rotation and")
print("# Reference Systems Service. A line: a modified Julian date, UT1 - UTC there in microseconds,")
print("# and what each of the next nine days adds (a leap second included). tests/reference/ut1_utc.py")
print("# is the recipe.")
for start in range(FIRST, last, 10):
    days = [values[day] for day in range(start, min(start + 10, last))]
    print(start, days[0], *[b - a for a, b in zip(days, days[1:])])
