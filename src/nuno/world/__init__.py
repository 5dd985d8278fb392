"""World: bodies that come and go, time, islands, snapshots."""
