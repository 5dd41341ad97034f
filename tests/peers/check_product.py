#!/usr/bin/env python3
"""Reads what a STEP file says of itself with Open CASCADE (package cadquery-ocp).

Usage: check_product.py MODEL.step --name NAME --schema SCHEMA --system PROGRAM [--since EPOCH]

Checked are the name of the product as a receiver shows it, that the schema's name begins with SCHEMA and the originating system with PROGRAM,
and that the time of writing lies between EPOCH (seconds since 1970) and now. Exits with 1 at the first that fails.
"""

import argparse
import datetime
import sys
import time

from OCP.IFSelect import IFSelect_RetDone
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_Reader


def names(path):
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        sys.exit(f"FAILED: {path} cannot be read")
    if reader.TransferRoots() != 1:
        sys.exit(f"FAILED: {path} cannot be transferred")
    model = reader.StepModel()
    entities = [model.Value(k) for k in range(1, model.NbEntities() + 1)]
    return [entity.Name().ToCString() for entity in entities if isinstance(entity, StepBasic_Product)]


def header(path):
    """The values of FILE_NAME and FILE_SCHEMA, which Open CASCADE keeps to itself: plain strings of the first lines."""
    with open(path, encoding="ascii") as file:
        lines = [line for line in (next(file) for _ in range(8)) if line.startswith(("FILE_NAME", "FILE_SCHEMA"))]
    return [[part for part in line.split("'")[1::2]] for line in lines]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("--name", required=True)
    parser.add_argument("--schema", required=True)
    parser.add_argument("--system", required=True)
    parser.add_argument("--since", type=float, default=0.0)
    arguments = parser.parse_args()
    found = names(arguments.model)
    if found != [arguments.name]:
        sys.exit(f"FAILED: the product is named {found}, not {arguments.name!r}")
    file_name, schema = header(arguments.model)
    if not schema[0].startswith(arguments.schema):
        sys.exit(f"FAILED: the schema is {schema[0]}")
    if not file_name[-2].startswith(arguments.system):
        sys.exit(f"FAILED: the originating system is {file_name[-2]!r}")
    written = datetime.datetime.fromisoformat(file_name[1]).timestamp()
    if not int(arguments.since) <= written <= time.time():
        sys.exit(f"FAILED: it was written at {file_name[1]}")
    print(f"{arguments.model}: {arguments.name!r}, {schema[0].split()[0]}, {file_name[-2]}, {file_name[1]}")


if __name__ == "__main__":
    main()
