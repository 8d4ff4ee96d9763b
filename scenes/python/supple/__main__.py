"""What the command line tool leaves to Python: `python3 -m supple plot FOLDER COLUMN [--over KEY ...] [--svg FILE]`."""
import argparse
import pathlib
import re
import sys

from supple import Error
from supple._experiments import read_table


def main():
    parser = argparse.ArgumentParser(prog="python3 -m supple", description="plots a column of the table of a sweep")
    parser.add_argument("what", choices=["plot"])
    parser.add_argument("folder")
    parser.add_argument("column")
    parser.add_argument("--over", action="append", help="key of an axis; twice for a map of colours")
    parser.add_argument("--svg", help="file to write (default: COLUMN.svg in the folder)")
    a = parser.parse_args()
    path = a.svg or pathlib.Path(a.folder) / (re.sub(r"[^A-Za-z0-9_.-]", "_", a.column) + ".svg")
    try:
        read_table(a.folder).plot(a.column, a.over, path)
    except Error as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(f"plot:   {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
