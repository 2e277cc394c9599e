"""Adapters to other libraries, each in its own module, which needs its library only when it is used."""
