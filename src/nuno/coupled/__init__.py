"""Contacts, ties and joints between bodies that move, solved together."""
