"""Engines: what makes dynamics and steps them, Nuno's own or another simulator's, behind one protocol."""
