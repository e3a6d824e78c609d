"""Interfaces of other packages, served by kerrlight's rays: :mod:`kerrlight.compat.kgeo`."""
