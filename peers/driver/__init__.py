"""Runs the peers and tells what they cost; see peers/README.md."""
