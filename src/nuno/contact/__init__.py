"""Contact of particles: with shapes (`nuno.contact.particle`), and of a body with itself (`nuno.contact.self`)."""
