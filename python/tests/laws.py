"""A law of polarised light for several tests: a toroidal field."""

from kerrlight import PolarizationLaw

LAW = PolarizationLaw(
    vertical=0.0,
    radial=0.0,
    toroidal=1.0,
    radial_sine_power=0.0,
    components="orthonormal",
    frame="gas",
    redshift_power=2.0,
    field_power=0.0,
    sine_power=0.0,
    fraction=0.5,
    normalisation="none",
    turn_deg=0.0,
)
