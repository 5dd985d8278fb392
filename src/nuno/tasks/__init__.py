"""Tasks: whole experiments on a robot and what it handles, as functions that return a result with its pictures."""
