"""Estimating what a camera saw: silhouette scores, the state of a picked cloth, replays of folding."""
