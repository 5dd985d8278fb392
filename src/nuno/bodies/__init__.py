"""Bodies, and what they have while dynamics are attached to them."""
