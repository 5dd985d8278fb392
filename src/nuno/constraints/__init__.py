"""XPBD constraints of cloth and soft bodies, one a file, and the compliances that they take."""
