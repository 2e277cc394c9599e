"""Doors into other libraries, each a module of its own that needs its library only when it is used."""
