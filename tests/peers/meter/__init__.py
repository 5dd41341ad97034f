"""The parts of measure_step.py: reading scans, triangles over a STEP file, the band of the sagitta, judgements,
crossings."""
