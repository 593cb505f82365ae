"""What a running board is asked and ordered: control, faults, jumps, snapshots, views."""
