#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""High-precision reference values for the critical curve of Kerr holes.

    pip install mpmath
    python critical_curve.py > critical_curve.csv

Units G = c = M = 1.  The point of the curve at a given angle of the screen is found by
bisection in the radius of the spherical photon orbit, with the textbook forms (Gralla &
Lupsasca 2020b, arXiv:1910.12873)

    lambda = a + (r/a) [r - 2 Delta/(r - 1)],     eta = (r^3/a^2) [4 Delta/(r - 1)^2 - r],
    alpha = -lambda/sin i,     beta = +-sqrt(eta + a^2 cos^2 i - lambda^2 cot^2 i),

whose cancellations (a -> 0, |a| -> 1) are paid for with digits; on the axis lambda = 0 and
the curve is the circle alpha^2 + beta^2 = eta + a^2.  Without spin the curve is the circle
of radius sqrt(27).  On an extremal hole (|a| = 1) angles that see the straight part,
alpha = -2 a/sin i, get r = 1, where delta and tau are infinite.  With eta + lambda^2, u+ and u-
of the paper, and the complete integrals K, E, Pi (their parameter, the square of the modulus,
is u+/u-):

    gamma = 4/sqrt(-u- a^2) sqrt(r^2 - r Delta/(r - 1)^2) K
    delta = 2/sqrt(-u- a^2) [a (r + 1)/(r - 1) K + lambda Pi(u+)],  + 2 pi where lambda < 0
    tau = 2/sqrt(-u- a^2) [((r^2 + a^2)(r^2 + a^2 - a lambda)/Delta + a (lambda - a)) K + a^2 u- (K - E)]

Every row is computed with 120 and 160 digits, which must agree to 1e-30.

Columns
  spin, inclination_deg, angle   inputs: exactly these doubles are meant
  r, lambda, eta, alpha, beta, gamma, delta, tau   25 digits
"""
from mpmath import mp, mpf

SPINS = [0.0, 1e-12, -1e-6, 0.1, -0.3, 0.499, 0.501, 0.94, -0.998, 1 - 1e-6, -(1 - 1e-12), 1.0, -1.0]
INCLINATIONS = [0.0, 1e-7, 17.0, 60.0, 90.0, 137.0]
ANGLES = [0.0, 1.1, 1.5707963267948966, 2.6, 3.1, 3.141592653589793, -2.3, -0.7]


def sin_cos(degrees):
    d = mpf(degrees)
    if degrees in (0, 180):
        return mpf(0), mpf(1 if degrees == 0 else -1)
    if degrees == 90:
        return mpf(1), mpf(0)
    return mp.sin(d * mp.pi / 180), mp.cos(d * mp.pi / 180)


def constants(a, r):
    delta = r * r - 2 * r + a * a
    lam = a + r / a * (r - 2 * delta / (r - 1))
    eta = r**3 / a**2 * (4 * delta / (r - 1) ** 2 - r)
    return lam, eta


def point(a, sin_i, cos_i, angle):
    """r (None on the straight part), lambda, eta, alpha, beta."""
    cos, sin = mp.cos(angle), mp.sin(angle)
    if a == 0:
        size = mp.sqrt(27)
        alpha, beta = size * cos, size * sin
        return mpf(3), -alpha * sin_i, alpha**2 * cos_i**2 + beta**2, alpha, beta
    if abs(a) == 1 and -a * cos > 0 and sin_i > 0:
        size = 2 / (sin_i * -a * cos)
        alpha, beta = size * cos, size * sin
        eta = (alpha**2 - 1) * cos_i**2 + beta**2
        if 0 <= eta <= 3:
            return None, 2 * a, eta, alpha, beta
    # |a| from here on: the mirror image has the opposite lambda and angle.
    sense = 1 if a > 0 else -1
    b = abs(a)
    low = 2 * (1 + mp.cos(2 * mp.acos(-b) / 3))
    high = 2 * (1 + mp.cos(2 * mp.acos(b) / 3))

    def miss(r):
        lam, eta = constants(b, r)
        return lam + sense * sin_i * cos * mp.sqrt(abs(lam**2 + eta + (b * cos_i) ** 2))

    if b == 1:
        low = mpf(10) ** (-mp.dps // 2) + 1
    for _ in range(int(3.4 * mp.dps)):
        middle = (low + high) / 2
        if miss(middle) > 0:
            low = middle
        else:
            high = middle
    r = (low + high) / 2
    lam, eta = constants(b, r)
    size = mp.sqrt(lam**2 + eta + (b * cos_i) ** 2)
    return r, sense * lam, eta, size * cos, size * sin


def half_orbit(a, r, lam, eta):
    if a == 0:
        mino = mp.pi / mp.sqrt(27)
        return 2 * mp.sqrt(mpf(27) / 4) * mino, mp.pi, 27 * mino
    total = eta + lam**2
    half = (1 - total / a**2) / 2
    root = mp.sqrt(half**2 + eta / a**2)
    up, um = half + root, half - root
    m = up / um
    scale = 2 / mp.sqrt(-um * a * a)
    if r is None:
        # (Delta/(r - 1)^2 -> 1 - y^2 with eta = 3 - 4 y^2)
        gamma = 2 * mp.sqrt((3 - eta) / 4) * scale * mp.ellipk(m)
        return gamma, mp.inf * a, mp.inf
    delta = r * r - 2 * r + a * a
    gamma = 2 * scale * mp.sqrt(r * r - r * delta / (r - 1) ** 2) * mp.ellipk(m)
    turned = scale * a * (r + 1) / (r - 1) * mp.ellipk(m)
    if abs(lam) < mpf(10) ** (-mp.dps // 2):
        turned += mp.pi
    else:
        # Pi(n | m) with n = up -> 1: written by R_J, which takes 1 - n without cancellation.
        rest = lam**2 / (a * a * (1 - um))
        pi_integral = mp.elliprf(0, 1 - m, 1) + up / 3 * mp.elliprj(0, 1 - m, 1, rest)
        turned += scale * lam * pi_integral
        if lam < 0:
            turned += 2 * mp.pi
    return gamma, turned, tau_of(a, r, lam, um, m, scale)


def tau_of(a, r, lam, um, m, scale):
    """dt/dMino = (r^2 + a^2)(r^2 + a^2 - a lambda)/Delta + a (lambda - a) + a^2 u^2, and
    int u^2 = scale um (K - E) over half an orbit."""
    delta = r * r - 2 * r + a * a
    rate = (r * r + a * a) * (r * r + a * a - a * lam) / delta + a * (lam - a)
    return scale * (rate * mp.ellipk(m) + a * a * um * (mp.ellipk(m) - mp.ellipe(m)))


def row(spin, degrees, angle):
    a, s = mpf(spin), mpf(angle)
    sin_i, cos_i = sin_cos(degrees)
    r, lam, eta, alpha, beta = point(a, sin_i, cos_i, s)
    values = half_orbit(a, r, lam, eta)
    return [mpf(1) if r is None else r, lam, eta, alpha, beta, *values]


def agreed(spin, degrees, angle):
    mp.dps = 160
    exact = row(spin, degrees, angle)
    mp.dps = 120
    for x, y in zip(exact, row(spin, degrees, angle)):
        assert x == y or abs(x - y) < mpf(10) ** -30 * max(1, abs(x)), (spin, degrees, angle, x, y)
    return exact


def main():
    print("# Points of the critical curve of Kerr holes at given angles of the screen, mpmath, "
          "25 digits; made by critical_curve.py, which documents the columns")
    print("spin,inclination_deg,angle,r,lambda,eta,alpha,beta,gamma,delta,tau")
    for spin in SPINS:
        for degrees in INCLINATIONS:
            for angle in ANGLES:
                values = agreed(spin, degrees, angle)
                inputs = [f"{x:.17g}" for x in (spin, degrees, angle)]
                # What is zero to all digits is written as 0.
                texts = [mp.nstr(v if abs(v) > mpf(10) ** -40 else mpf(0), 25) for v in values]
                print(",".join(inputs + [t.replace("+inf", "inf") for t in texts]))


if __name__ == "__main__":
    main()
