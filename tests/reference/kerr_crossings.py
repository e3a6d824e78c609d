#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""High-precision reference values for null geodesics of the Kerr metric.

    pip install mpmath            (gmpy2 is optional and makes it several times faster)
    python kerr_crossings.py > kerr_crossings.csv
    python kerr_crossings.py --check      extra cross-checks, nothing written but a report

Units G = c = M = 1.  Every ray is traced backward from an observer at infinity
(inclination i, azimuth 0) through the screen point (alpha, beta):

    lambda = -alpha sin i,     eta = (alpha^2 - a^2) cos^2 i + beta^2,     E = 1.

The numbers come from the separated Boyer-Lindquist first integrals, in Mino time
tau (which grows backward from 0 at infinity):

    dr/dtau     = -+ sqrt(R),   R = P^2 - Delta [eta + (lambda - a)^2],  P = r^2 + a^2 - a lambda
    du/dtau     = +- sqrt(U),   U = eta + (a^2 - eta - lambda^2) u^2 - a^2 u^4,   u = cos(theta)
    dphi/dtau   = -(a P/Delta - a + lambda/sin^2 theta)
    d(t_o-t)/dtau = (r^2 + a^2) P/Delta + a (lambda - a sin^2 theta)

    delay = lim over r_o of [(t_o - t) - r_o - 2 ln r_o].

Polar motion.  u = u_max cos(chi) turns tau and the integral of u^2 into Legendre
integrals F and E; a crossing of the equator is chi = pi/2 + n pi.  The integral of
lambda/sin^2 theta has its near-pole peak removed in closed form (an arc tangent),
the smooth remainder is integrated numerically.

Radial motion.  w = 1/r.  The two roots of R that pinch the path near the critical
curve are taken out by  w = w3 - (w4 - w3) sinh^2 x  (real roots w3 < w4) or
w = p + q sinh x  (complex roots p +- i q), so that dtau = regular function * dx,
turning point included.  The radial integrals are adaptive Gauss-Legendre sums in x,
never across the horizon; 1 + 2/r is subtracted from the integrand of t in exact
polynomial arithmetic, and its integral is added analytically.  r at a crossing solves
tau(r) = tau_k by Newton's method on that same integral.

Every ray is evaluated twice (more digits, another quadrature order) and is left out
unless all outputs agree to about 27 digits.

Columns
  spin, inclination_rad, alpha, beta   the inputs, 17 digits: exactly these doubles are meant
  outcome      captured | escaped
  crossings    equatorial crossings outside the outer horizon over the whole backward ray
               (the starting point at infinity is not counted)
  mino_total   Mino time from infinity to the outer horizon, or from infinity to infinity
  r_min        radial turning point (empty when captured)
  mino_k, r_k, phi_k, delay_k   k = 1, 2, 3: the k-th crossing (empty when there is none)
  cond         sensitivity to the inputs' rounding: each nonzero input moved by one part in
               2^53 (linearised); sum over the inputs, maximum over r_k (relative),
               phi_k (absolute) and delay_k (relative to max(1, |delay_k|)); k <= 3
  class        short label

phi is unwrapped along the backward ray and starts at 0.  With lambda = 0 (alpha = 0 or
sin i = 0) the ray goes through the pole, where phi jumps: the value is then the limit
alpha -> 0+ (each passage adds +pi), or for i = 0 the limit i -> 0+ (phi starts with the
jump atan2(alpha, -beta), each later passage adds pi sign(alpha), + for alpha = 0).
"""
import math
import random
import sys

import mpmath as mp
from mpmath import mpf

# (decimal digits, Gauss-Legendre points, quadrature tolerance)
MAIN = (60, 40, '1e-38')
CONFIRM = (76, 54, '1e-50')
ROUGH = (48, 32, '1e-36')     # for the condition numbers
AGREE = '2e-27'               # what MAIN and CONFIRM must agree to

# --------------------------------------------------------------------------- quadrature


class Gauss:
    """Gauss-Legendre rule on [-1, 1]."""
    cache = {}

    def __new__(cls, n, dps):
        key = (n, dps)
        if key not in cls.cache:
            self = object.__new__(cls)
            with mp.workdps(dps + 15):
                self.rule = []
                for i in range(1, n // 2 + 1):
                    x = mp.cos(mp.pi * (i - mpf(1) / 4) / (n + mpf(1) / 2))
                    for _ in range(60):
                        p0, p1 = mpf(1), x
                        for k in range(2, n + 1):
                            p0, p1 = p1, ((2 * k - 1) * x * p1 - (k - 1) * p0) / k
                        dp = n * (x * p1 - p0) / (x * x - 1)
                        dx = p1 / dp
                        x -= dx
                        if abs(dx) < mpf(10) ** (-(dps + 8)):
                            break
                    wt = 2 / ((1 - x * x) * dp * dp)
                    self.rule += [(x, wt), (-x, wt)]
            assert n % 2 == 0
            cls.cache[key] = self
        return cls.cache[key]

    def integrate(self, f, lo, hi):
        """Vector-valued f."""
        mid, half = (lo + hi) / 2, (hi - lo) / 2
        total = None
        for x, wt in self.rule:
            v = f(mid + half * x)
            total = [wt * q for q in v] if total is None else [s + wt * q for s, q in zip(total, v)]
        return [half * s for s in total]

    def panels(self, f, lo, hi, tol):
        """Adaptive bisection: the list of (lo, hi, integral), in order."""
        out = []
        stack = [(lo, hi, self.integrate(f, lo, hi), 0)]
        while stack:
            lo, hi, whole, depth = stack.pop()
            mid = (lo + hi) / 2
            left, right = self.integrate(f, lo, mid), self.integrate(f, mid, hi)
            both = [p + q for p, q in zip(left, right)]
            if all(abs(p - q) <= tol * max(1, abs(p)) for p, q in zip(both, whole)):
                out += [(lo, mid, left), (mid, hi, right)]
            else:
                if depth > 400:
                    raise ArithmeticError('quadrature does not converge')
                stack += [(mid, hi, right, depth + 1), (lo, mid, left, depth + 1)]
        return out


def polymul(p, q):
    out = [mpf(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            out[i + j] += x * y
    return out


def horner(p, x):
    s = p[-1]
    for c in p[-2::-1]:
        s = s * x + c
    return s


# --------------------------------------------------------------------------- constants of motion


def constants(a, inc, alpha, beta):
    si, ci = mp.sin(inc), mp.cos(inc)
    lam = -alpha * si
    eta = (alpha ** 2 - a ** 2) * ci ** 2 + beta ** 2
    return si, ci, lam, eta


def radial_roots(a, lam, eta):
    """Roots of R(r) = r^4 + A r^2 + B r + C."""
    A = a * a - eta - lam * lam
    B = 2 * (eta + (lam - a) ** 2)
    C = -a * a * eta
    with mp.workdps(mp.mp.dps + 30):
        coeffs = [mpf(1), mpf(0), A, B, C]
        zeros = []
        while len(coeffs) > 1 and coeffs[-1] == 0:
            coeffs.pop()
            zeros.append(mp.mpc(0))
        roots = mp.polyroots(coeffs, maxsteps=2000, extraprec=400) if len(coeffs) > 1 else []
        roots = [mp.mpc(r) for r in roots] + zeros
        scale = max(abs(r) for r in roots)
        small = mpf(10) ** (-(mp.mp.dps - 25))
        real, cplx = [], []
        for r in roots:
            if abs(r.imag) <= small * abs(r):
                real.append(r.real)
            elif r.imag > 0:
                cplx.append(r)
        assert len(real) + 2 * len(cplx) == 4 and scale > 0
        real.sort()
    return real, cplx


class Radial:
    """tau, phi and t integrals along r for one ray."""

    def __init__(self, a, lam, eta, gauss, tol):
        self.a, self.lam, self.gauss, self.tol = a, lam, gauss, tol
        self.rp = rp = 1 + mp.sqrt((1 - a) * (1 + a))
        self.real, self.cplx = real, cplx = radial_roots(a, lam, eta)
        outer = [r for r in real if r > rp]
        self.escaped = bool(outer)
        self.r_min = outer[-1] if outer else None
        w_end = 1 / self.r_min if outer else 1 / rp
        self.W = [mpf(1), mpf(0), a * a - eta - lam * lam, 2 * (eta + (lam - a) ** 2), -a * a * eta]
        self.D = [mpf(1), mpf(-2), a * a]                              # Delta/r^2
        self.N = polymul([mpf(1), mpf(0), a * a], [mpf(1), mpf(0), a * a - a * lam])
        D12 = polymul(self.D, [mpf(1), mpf(2)])                        # (1 + 2w) Delta/r^2
        n2 = polymul(self.N, self.N)
        d2w = polymul(polymul(D12, D12), self.W)
        m = max(len(n2), len(d2w))
        diff = [(n2[k] if k < len(n2) else 0) - (d2w[k] if k < len(d2w) else 0) for k in range(m)]
        assert diff[0] == 0 and diff[1] == 0
        self.Q, self.D12 = diff[2:], D12

        # the change of variable
        positive = sorted((r for r in real if r > 0), reverse=True)
        pair = [r for r in cplx if r.real > 0]
        if len(positive) >= 2 and (self.escaped or not pair):
            ra, rb = positive[0], positive[1]          # w3 = 1/ra < w4 = 1/rb
            rest = list(real)
            rest.remove(ra)
            rest.remove(rb)
            if cplx:
                s1, s2 = 2 * cplx[0].real, abs(cplx[0]) ** 2
            else:
                s1, s2 = rest[0] + rest[1], rest[0] * rest[1]
            w3, sg2 = 1 / ra, 1 / rb - 1 / ra
            sg = mp.sqrt(sg2)
            fac = 2 / mp.sqrt(ra * rb)

            def point(x):                               # w, dw/dtau, dtau/dx
                sh, ch = mp.sinh(x), mp.cosh(x)
                w = w3 - sg2 * sh * sh
                dtau = fac / mp.sqrt(1 - s1 * w + s2 * w * w)
                return w, -2 * sg2 * sh * ch / dtau, dtau
            self.x0 = -mp.asinh(mp.sqrt(w3) / sg)
            # (a ray that just falls in: w_end < w3)
            self.x1 = mpf(0) if self.escaped else -mp.asinh(mp.sqrt(w3 - w_end) / sg)
            self.kind = 'real pair'
        elif pair and abs(1 / max(pair, key=lambda r: abs(r))) < 10:
            rc = max(pair, key=lambda r: abs(r))
            if len(cplx) == 2:
                other = [r for r in cplx if r is not rc][0]
                s1, s2 = 2 * other.real, abs(other) ** 2
            else:
                s1, s2 = real[0] + real[1], real[0] * real[1]
            wc = 1 / rc
            p, q = wc.real, abs(wc.imag)
            fac = 1 / abs(rc)

            def point(x):
                sh, ch = mp.sinh(x), mp.cosh(x)
                w = p + q * sh
                dtau = fac / mp.sqrt(1 - s1 * w + s2 * w * w)
                return w, q * ch / dtau, dtau
            self.x0, self.x1 = -mp.asinh(p / q), mp.asinh((w_end - p) / q)
            self.kind = 'complex pair'
        else:
            def point(x):
                sw = mp.sqrt(horner(self.W, x))
                return x, sw, 1 / sw
            self.x0, self.x1 = mpf(0), w_end
            self.kind = 'plain'
        self.point = point

        # Mino time to the turning point or the horizon
        self.table, acc = [], mpf(0)
        for lo, hi, v in gauss.panels(lambda x: [point(x)[2]], self.x0, self.x1, tol):
            self.table.append((lo, hi, acc))
            acc += v[0]
        self.half = acc
        self.mino_total = 2 * acc if self.escaped else acc

    def invert(self, tau):
        """x and w at Mino time tau on the inward leg."""
        lo, hi, acc = [e for e in self.table if e[2] <= tau][-1]
        x = lo + (tau - acc) / self.point(lo)[2]
        x = min(max(x, lo), hi)
        for _ in range(60):
            t = acc + (self.gauss.integrate(lambda y: [self.point(y)[2]], lo, x)[0] if x != lo else 0)
            dx = (tau - t) / self.point(x)[2]
            x = min(max(x + dx, lo), hi)
            if abs(dx) < mpf(10) ** (-(mp.mp.dps - 8)) * max(1, abs(x)):
                break
        else:
            raise ArithmeticError('Newton does not converge')
        return x, self.point(x)[0]

    def integrand(self, x):
        """d/dx of: phi integral (a P/Delta - a), regularised t integral."""
        a, lam = self.a, self.lam
        w, sw, dtau = self.point(x)
        D = horner(self.D, w)
        iphi = a * w * (2 - a * lam * w) / D
        it = horner(self.Q, w) / (D * (horner(self.N, w) + horner(self.D12, w) * sw))
        return [iphi * dtau, it * dtau]

    def to(self, x_from, x_to):
        tot = [mpf(0), mpf(0)]
        if x_to == x_from:
            return tot
        for _, _, v in self.gauss.panels(self.integrand, x_from, x_to, self.tol):
            tot = [p + q for p, q in zip(tot, v)]
        return tot


class Polar:
    """theta motion; u0 = cos i > 0 after reflection, eta > 0."""

    def __init__(self, a, si, ci, lam, eta, alpha, beta, gauss, tol):
        if ci < 0:
            ci, beta = -ci, -beta
        A = a * a - eta - lam * lam
        s = mp.sqrt(A * A + 4 * a * a * eta)
        v = 2 * eta / (s - A) if A <= 0 else (s + A) / (2 * a * a)       # u_max^2
        b = a * a + eta + lam * lam
        lc = (b + mp.sqrt((b - 2 * a * lam) * (b + 2 * a * lam))) / 2   # lambda^2 / c
        c = lam * lam / lc                                               # 1 - u_max^2
        h0 = eta / v + a * a * v
        m = a * a * v / h0
        self.a, self.v, self.c, self.h0, self.m, self.eta, self.lam = a, v, c, h0, m, eta, lam
        sin0 = abs(beta) * si / mp.sqrt(v * (a * a * ci * ci + eta / v))
        cos0 = ci / mp.sqrt(v)
        self.chi0 = chi0 = mp.atan2(sin0, cos0) * (-1 if beta > 0 else 1)
        self.sign = (1 if lam > 0 else -1) if lam != 0 else (-1 if alpha >= 0 else 1)
        self.kappa = mp.sqrt(lc / h0)
        if si == 0:
            self.y0 = -mp.atan2(beta, abs(alpha))
        elif c == 0:
            self.y0 = mp.sign(chi0) * mp.pi / 2
        else:
            self.y0 = mp.atan2(mp.sin(chi0), mp.sqrt(c) * mp.cos(chi0))
        self.K, self.E = mp.ellipk(m), mp.ellipe(m)
        self.F0, self.E0 = mp.ellipf(chi0, m), mp.ellipe(chi0, m)
        self.gauss, self.tol = gauss, tol
        self.J = None

    def mino(self, k):
        return ((2 * k - 1) * self.K - self.F0) / mp.sqrt(self.h0)

    def smooth(self, chi):
        s2 = mp.sin(chi) ** 2
        c2 = 1 - s2
        h = mp.sqrt(self.eta / self.v + self.a ** 2 * self.v * c2)
        g = mp.sqrt(self.h0)
        return [self.lam * self.a ** 2 * self.v * s2 / (h * g * (h + g) * (s2 + self.c * c2))]

    def phi(self, k):
        """integral of lambda/sin^2 theta up to crossing k"""
        main = self.sign * self.kappa * ((2 * k - 1) * mp.pi / 2 - self.y0)
        if self.lam == 0 or self.a == 0:
            return main
        if self.J is None:
            def J(x):
                return sum((p[2][0] for p in self.gauss.panels(self.smooth, mpf(0), x, self.tol)), mpf(0)) if x else mpf(0)
            self.J = J(mp.pi / 2), mp.sign(self.chi0) * J(abs(self.chi0))
        return main + (2 * k - 1) * self.J[0] - self.J[1]

    def usq(self, k):
        """integral of a^2 cos^2 theta"""
        return mp.sqrt(self.h0) * ((2 * k - 1) * self.E - self.E0) - self.eta / self.v * self.mino(k)


def trace(ray, setting, kmax=3):
    dps, n, tol = setting
    with mp.workdps(dps):
        a, inc, alpha, beta = (mpf(x) for x in ray)
        gauss, tol = Gauss(n, dps), mpf(tol)
        si, ci, lam, eta = constants(a, inc, alpha, beta)
        rad = Radial(a, lam, eta, gauss, tol)
        out = dict(escaped=rad.escaped, mino_total=rad.mino_total, r_min=rad.r_min, cross=[], crossings=0,
                   kind=rad.kind, rad=rad, pol=None, lam=lam, eta=eta)
        if eta <= 0:
            if eta == 0:
                raise ArithmeticError('eta = 0')
            return out
        out['pol'] = pol = Polar(a, si, ci, lam, eta, alpha, beta, gauss, tol)
        k = 1
        while pol.mino(k) < rad.mino_total:
            k += 1
        out['crossings'] = k - 1
        turn = None
        for k in range(1, min(out['crossings'], kmax) + 1):
            tau = pol.mino(k)
            after = rad.escaped and tau > rad.half
            x, w = rad.invert(rad.mino_total - tau if after else tau)
            iphi, it = rad.to(rad.x0, x)
            it = it - 1 / w + 2 * mp.log(w)
            if after:
                if turn is None:
                    tp, tt = rad.to(rad.x0, rad.x1)
                    turn = tp, tt - rad.r_min - 2 * mp.log(rad.r_min)
                iphi, it = 2 * turn[0] - iphi, 2 * turn[1] - it
            phi = -iphi - pol.phi(k)
            delay = it + a * (lam - a) * tau + pol.usq(k)
            out['cross'].append((tau, 1 / w, phi, delay))
        return out


def numbers(o):
    """[(value, scale)] of everything that is written"""
    out = [(o['mino_total'], abs(o['mino_total']))]
    if o['escaped']:
        out.append((o['r_min'], abs(o['r_min'])))
    for tau, r, phi, delay in o['cross']:
        out += [(tau, tau), (r, r), (phi, max(1, abs(phi))), (delay, max(1, abs(delay)))]
    return out


def difference(o, p):
    if o['escaped'] != p['escaped'] or o['crossings'] != p['crossings']:
        return mp.inf
    return max(abs(x - y) / s for (x, s), (y, _) in zip(numbers(o), numbers(p)))


def condition(ray):
    base = trace(ray, ROUGH)
    with mp.workdps(ROUGH[0]):
        eps = mpf(10) ** -20
        move = {}
        for j in range(4):
            if ray[j] == 0 or not base['cross']:
                continue
            other = [mpf(x) for x in ray]
            other[j] *= 1 - eps
            p = trace(other, ROUGH)
            if p['crossings'] != base['crossings']:
                raise ArithmeticError('crossings change under rounding')
            for k, (x, y) in enumerate(zip(base['cross'], p['cross'])):
                for c, s in ((1, x[1]), (2, mpf(1)), (3, max(1, abs(x[3])))):
                    move[k, c] = move.get((k, c), 0) + abs(x[c] - y[c]) / s / eps * mpf(2) ** -53
        return max(move.values()) if move else mpf(0)


# --------------------------------------------------------------------------- critical curve


def critical_radius(a, inc, psi, guess=None):
    """Distance of the critical curve from the screen's origin in direction psi."""
    with mp.workdps(50):
        a, inc, psi = mpf(a), mpf(inc), mpf(psi)
        cs, sn = mp.cos(psi), mp.sin(psi)

        def captured(rho):
            _, _, lam, eta = constants(a, inc, rho * cs, rho * sn)
            real, _ = radial_roots(a, lam, eta)
            return not [r for r in real if r > 1 + mp.sqrt(1 - a * a)]
        lo, hi = mpf(1), mpf(9)
        assert captured(lo) and not captured(hi)
        with mp.workdps(20):
            for _ in range(24):
                mid = (lo + hi) / 2
                if captured(mid):
                    lo = mid
                else:
                    hi = mid
            _, _, lam, eta = constants(a, inc, hi * cs, hi * sn)
            real, _ = radial_roots(a, lam, eta)

        def f(rho, r):
            _, _, lam, eta = constants(a, inc, rho * cs, rho * sn)
            A, B, C = a * a - eta - lam * lam, 2 * (eta + (lam - a) ** 2), -a * a * eta
            return [r ** 4 + A * r * r + B * r + C, 4 * r ** 3 + 2 * A * r + B]
        sol = mp.findroot(f, (mpf(hi), real[-1]), tol=mpf(10) ** -80)
        assert abs(sol[0] - hi) < 1e-5
        return sol[0]


# --------------------------------------------------------------------------- the rays


def rays():
    """Yields (class, spin, inclination, alpha, beta), all doubles."""
    rng = random.Random(20240229)
    rad = math.pi / 180

    def uni(lo, hi, digits=6):
        return round(rng.uniform(lo, hi), digits)

    fixed = [0.1, 0.5, 0.9, 0.94, 0.998, -0.1, -0.5, -0.9, -0.94, -0.998]
    for k in range(84):
        if k < 40:
            a = fixed[k % len(fixed)]
        else:
            a = uni(-1, 1)
        # every third ray inside a smaller field, where the interesting paths are
        f = 6.5 if k % 3 == 0 else 12.0
        yield 'generic', a, uni(1, 179, 3) * rad, uni(-f, f), uni(-f, f)

    for a, inc, b in [(0.9, 60, 3.7), (0.9, 60, -3.7), (0.5, 20, 7.3), (-0.8, 130, -5.5), (0.998, 85, 5.25), (0.0, 45, 4.0), (0.7, 75, -9.0)]:
        yield 'alpha_zero', a, inc * rad, 0.0, b
    for a, inc, b in [(0.9, 60, 3.7), (0.5, 110, -6.1), (-0.94, 25, 5.6)]:
        for al in (1e-6, -1e-9, 1e-12):
            yield 'alpha_tiny', a, inc * rad, al, b
    for a, inc, al in [(0.9, 60, 4.4), (0.9, 60, -6.5), (-0.5, 120, 5.75), (0.3, 17, 3.1), (0.998, 88, -8.0)]:
        yield 'beta_zero', a, inc * rad, al, 0.0
    for a, inc, al in [(0.9, 60, 4.4), (0.9, 60, -6.5), (-0.5, 120, 5.75)]:
        for b in (1e-9, -1e-9):
            yield 'beta_tiny', a, inc * rad, al, b

    half = math.pi / 2
    for name, inc in [('inc_zero', 0.0), ('inc_1e-7', 1e-7), ('inc_1e-3', 1e-3)]:
        for a, al, b in [(0.94, 3.0, 4.0), (0.94, -2.5, 4.75), (-0.6, 5.5, -1.25), (0.5, 0.0, 6.0)]:
            yield name, a, inc, al, b
    for a, al, b in [(0.94, 4.0, 0.0), (0.94, 0.0, -5.75), (0.0, -4.5, 3.5)]:
        yield 'inc_zero', a, 0.0, al, b
    for name, inc in [('inc_pi', math.pi), ('inc_pi-1e-7', math.pi - 1e-7), ('inc_pi-1e-3', math.pi - 1e-3)]:
        for a, al, b in [(0.94, 3.0, 4.0), (-0.6, 5.5, -1.25), (0.8, -4.9, 2.0)]:
            yield name, a, inc, al, b
    for name, inc in [('inc_pi/2', half), ('inc_pi/2+1e-6', half + 1e-6), ('inc_pi/2-1e-6', half - 1e-6)]:
        for a, al, b in [(0.94, -2.5, 4.5), (0.94, 4.0, -4.6), (-0.5, 5.0, 3.0), (0.7, -4.0, -2.5), (0.9, 5.5, 0.0), (0.9, 7.0, 1e-9)]:
            yield name, a, inc, al, b

    places = [(60, -3.5, 3.75), (17, 5.0, 2.0), (140, -4.0, -4.5), (85, 1.5, 2.5)]
    for name, a in [('spin_0', 0.0), ('spin_1e-12', 1e-12), ('spin_1e-12', -1e-12), ('spin_1e-6', 1e-6), ('spin_1e-6', -1e-6),
                    ('spin_1-1e-6', 1 - 1e-6), ('spin_1-1e-12', 1 - 1e-12), ('spin_1', 1.0), ('spin_-1', -1.0)]:
        for inc, al, b in places:
            yield name, a, inc * rad, al, b

    for a, inc, al, b in [(0.9, 10, 0.3, 0.2), (0.94, 17, -0.4, 0.5), (0.998, 30, 0.1, -0.7), (-0.8, 20, -0.2, -0.3), (0.5, 5, 0.05, 0.35),
                          (0.94, 165, 0.25, 0.3), (1.0, 12, 0.4, 0.6), (0.94, 0, 0.3, 0.4), (0.9, 60, 0.2, 0.1)]:
        yield 'vortical', a, inc * rad, al, b

    dirs = [0.4, 1.3, 2.2, 2.9, -0.6, -1.5, -2.4]
    incs = [60, 17, 80, 120, 45]
    j = 0
    for a in (0.0, 0.5, 0.9, 0.998, -0.7):
        inc = incs[j % 5] * rad
        for e in (3, 6, 9, 12, 13):
            psi = dirs[(2 * j + 3 * e) % 7]
            rho = critical_radius(a, inc, psi)
            for s in (1, -1):
                with mp.workdps(50):
                    d = rho * (1 + s * mpf(10) ** -e)
                    al, b = float(d * mp.cos(mpf(psi))), float(d * mp.sin(mpf(psi)))
                yield 'near_critical_%s1e-%d' % ('+' if s > 0 else '-', e), a, inc, al, b
        j += 1

    for e in range(2, 7):
        s = 10.0 ** e
        yield 'large_1e%d' % e, 0.9, 60 * rad, 0.6 * s, 0.8 * s
        yield 'large_1e%d' % e, -0.94, 163 * rad, -0.28 * s, 0.96 * s
        yield 'large_1e%d' % e, 0.5, 89 * rad, 0.8 * s, -0.6 * s
    for a, inc, al, b in [(0.0, 60, 1e-12, 1e-12), (0.0, 120, -1e-12, 0.0), (0.9, 60, 1e-12, -1e-12), (0.998, 17, 0.0, 1e-12), (0.5, 135, 1e-12, 1e-12)]:
        yield 'tiny', a, inc * rad, al, b


# --------------------------------------------------------------------------- independent checks (--check)


def jacobi_r(rad, tau):
    """r(tau) of an escaping ray from its four real roots and Jacobi's sn (complete path, both legs)."""
    r1, r2, r3, r4 = rad.real
    m = (r3 - r2) * (r4 - r1) / ((r3 - r1) * (r4 - r2))
    x0 = mp.sqrt((r3 - r1) / (r4 - r1))
    y = mp.sqrt((r3 - r1) * (r4 - r2)) / 2 * tau - mp.ellipf(mp.asin(x0), m)
    sn2 = mp.ellipfun('sn', y, m=m) ** 2
    return (r4 * (r3 - r1) - r3 * (r4 - r1) * sn2) / ((r3 - r1) - (r4 - r1) * sn2)


def carlson_tau(rad, r):
    """Mino time from infinity in to r, by Carlson's R_F and the four roots of R, complex or not."""
    z = [mp.mpc(x) for x in rad.real] + [y for x in rad.cplx for y in (x, mp.conj(x))]
    y = [mp.sqrt(r - x) for x in z]
    return 2 * mp.elliprf(*[(y[i] * y[j] + y[k] * y[m]) ** 2 for i, j, k, m in ((0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2))])


def legendre_phi(pol, k):
    """integral of lambda/sin^2 theta by Legendre's third integral (0 < u_max < 1)"""
    m = -pol.a ** 2 * pol.v ** 2 / pol.eta
    if pol.chi0 < 0:                                    # u = u_max sin(psi), start beyond the maximum
        psi0 = mp.pi / 2 + pol.chi0
        rest = 2 * mp.ellippi(pol.v, m) - mp.ellippi(pol.v, psi0, m)
    else:
        psi0 = mp.pi / 2 - pol.chi0
        rest = mp.ellippi(pol.v, psi0, m)
    return pol.lam / mp.sqrt(pol.eta / pol.v) * (rest + 2 * (k - 1) * mp.ellippi(pol.v, m))


def series_mul(p, q):
    n = len(p)
    return [mp.fsum(p[j] * q[k - j] for j in range(k + 1)) for k in range(n)]


def series_pow(p, e):
    """p^e for p[0] = 1"""
    out = [mpf(1)]
    for k in range(1, len(p)):
        out.append(mp.fsum((e * j - (k - j)) * p[j] * out[k - j] for j in range(1, k + 1)) / k)
    return out


def hamilton(ray, want, dps=44, w_start=mpf('0.001'), order=24):
    """Brute force: Hamilton's equations of the Kerr metric in Boyer-Lindquist coordinates, all six unseparated
    (the Carter constant only fixes the initial momentum), by Gragg-Bulirsch-Stoer extrapolation, from r >= 1000,
    where the state comes from power series in 1/r.  Returns `want` crossings (tau, r, phi, delay)."""
    with mp.workdps(dps):
        a, inc, alpha, beta = (mpf(x) for x in ray)
        si, ci, lam, eta = constants(a, inc, alpha, beta)
        n = 40

        def pad(p):
            return [mpf(x) for x in p] + [mpf(0)] * (n - len(p))

        def primitive(p, x):
            return mp.fsum(c * x ** (k + 1) / (k + 1) for k, c in enumerate(p))
        ws = w_start * min(1, 5 / max(1, mp.hypot(alpha, beta))) * min(1, 10 * si)
        # radial integrals from w = 0 to ws
        isw = series_pow(pad([1, 0, a * a - eta - lam ** 2, 2 * (eta + (lam - a) ** 2), -a * a * eta]), mpf(-1) / 2)
        iD = series_pow(pad([1, -2, a * a]), mpf(-1))
        tau = primitive(isw, ws)
        iphi = primitive(series_mul(series_mul(pad([0, 2 * a, -a * a * lam]), iD), isw), ws)
        f = series_mul(series_mul(series_mul(pad([1, 0, a * a]), pad([1, 0, a * a - a * lam])), iD), isw)
        assert abs(f[0] - 1) + abs(f[1] - 2) < mpf(10) ** (8 - dps)
        it = primitive(f[2:], ws) - 1 / ws + 2 * mp.log(ws)
        # polar motion: Taylor series in tau
        u = [ci, beta * si]
        A = a * a - eta - lam ** 2
        for k in range(n - 2):
            u2 = [mp.fsum(u[i] * u[j - i] for i in range(j + 1)) for j in range(k + 1)]
            u3 = mp.fsum(u[i] * u2[k - i] for i in range(k + 1))
            u.append((A * u[k] - 2 * a * a * u3) / ((k + 1) * (k + 2)))
        u2 = series_mul(u, u)
        s2 = [-x for x in u2]
        s2[0] += 1
        is2 = [x / s2[0] for x in series_pow([x / s2[0] for x in s2], mpf(-1))]
        phi = -iphi - lam * primitive(is2, tau)
        delay = it + a * (lam - a) * tau + a * a * primitive(u2, tau)
        us = mp.fsum(c * tau ** k for k, c in enumerate(u))
        ups = mp.fsum(k * c * tau ** (k - 1) for k, c in enumerate(u) if k)
        r, th = 1 / ws, mp.acos(us)
        d = r * r - 2 * r + a * a
        pr = mp.sqrt((r * r + a * a - a * lam) ** 2 - d * (eta + (lam - a) ** 2)) / d
        state = [delay, r, th, phi, pr, ups / mp.sin(th)]       # delay stands for -t

        def rhs(y):
            """- d/dtau (backward) of the future-directed ray, p_t = -1, p_phi = lambda, ds = Sigma dtau"""
            _, r, th, _, pr, pth = y
            s, c = mp.sin(th), mp.cos(th)
            s2, r2, a2 = s * s, r * r, a * a
            d, d1 = r2 - 2 * r + a2, 2 * r - 2
            sig = r2 + a2 * c * c
            X = (r2 + a2) ** 2 - a2 * d * s2
            num = -X + 4 * a * r * lam + (d - a2 * s2) * lam * lam / s2
            num_r = -(4 * r * (r2 + a2) - a2 * d1 * s2) + 4 * a * lam + d1 * lam * lam / s2
            num_th = 2 * a2 * d * s * c - 2 * d * lam * lam * c / (s2 * s)
            G = d * pr * pr + pth * pth + num / d              # 2 Sigma H
            G_r = d1 * pr * pr + num_r / d - num * d1 / (d * d)
            G_th = num_th / d
            tdot = (X - 2 * a * r * lam) / d
            phidot = (2 * a * r + (d - a2 * s2) * lam / s2) / d
            prdot = -(G_r - G * 2 * r / sig) / 2
            pthdot = -(G_th + G * 2 * a2 * s * c / sig) / 2
            return [tdot, -d * pr, -pth, -phidot, -prdot, -pthdot]

        def step(y, h):
            rows = []
            f0 = rhs(y)
            for j in range(1, order + 1):
                nn = 2 * j
                q = h / nn
                z0, z1 = y, [p + q * v for p, v in zip(y, f0)]
                for _ in range(nn - 1):
                    z0, z1 = z1, [p + 2 * q * v for p, v in zip(z0, rhs(z1))]
                last = [(p + v + q * g) / 2 for p, v, g in zip(z1, z0, rhs(z1))]
                row = [last]
                for k in range(1, j):
                    den = (mpf(j) / (j - k)) ** 2 - 1
                    row.append([p + (p - v) / den for p, v in zip(row[k - 1], rows[-1][k - 1])])
                rows.append(row)
                if j > 6:
                    err = max(abs(p - v) / max(1, abs(p)) for p, v in zip(row[-1], row[-2]))
                    if err < mpf(10) ** (12 - dps):
                        return row[-1], True
            return row[-1], False
        found, h = [], mpf('0.3') * ws
        for _ in range(4000):
            new, ok = step(state, h)
            if not ok:
                h /= 2
                continue
            if (state[2] - mp.pi / 2) * (new[2] - mp.pi / 2) < 0:
                g = h * (mp.pi / 2 - state[2]) / (new[2] - state[2])
                for _ in range(30):
                    y, _ = step(state, g)
                    dg = (mp.pi / 2 - y[2]) / rhs(y)[2]
                    g += dg
                    if abs(dg) < mpf(10) ** (10 - dps):
                        break
                y, _ = step(state, g)
                found.append((tau + g, y[1], y[3], y[0]))
                if len(found) == want:
                    break
            tau, state, h = tau + h, new, h * mpf('1.25')
        return found


def check():
    worst = {'jacobi r': mpf(0), 'carlson tau': mpf(0), 'legendre phi': mpf(0)}
    count = dict.fromkeys(worst, 0)
    brute = 0
    every = {}

    def note(what, d, name, ray):
        worst[what] = max(worst[what], d)
        count[what] += 1
        if d > 1e-27:
            print(what, name, ray, mp.nstr(d, 3), flush=True)

    for name, *ray in rays():
        o = trace(ray, MAIN)
        with mp.workdps(MAIN[0]):
            rad = o['rad']
            d = abs(carlson_tau(rad, rad.r_min if o['escaped'] else rad.rp) / rad.half - 1)
            for k, (tau, r, phi, delay) in enumerate(o['cross'], 1):
                pol = o['pol']
                t = carlson_tau(rad, r)
                d = max(d, min(abs(t - tau), abs(rad.mino_total - t - tau) if o['escaped'] else mp.inf) / tau)
                if o['escaped'] and len(rad.real) == 4:
                    note('jacobi r', abs(jacobi_r(rad, tau) / r - 1), name, ray)
                if pol.c > 1e-14:
                    note('legendre phi', abs(legendre_phi(pol, k) - pol.phi(k)), name, ray)
            note('carlson tau', d, name, ray)
        every[name] = every.get(name, 0) + 1
        if o['cross'] and (name == 'generic' and every[name] % 7 == 1 or name in
                           ('beta_zero', 'inc_1e-3', 'spin_1', 'spin_-1', 'near_critical_-1e-6', 'near_critical_+1e-9') and every[name] % 3 == 2):
            cross = hamilton(ray, len(o['cross']))
            d = [max(abs(p[j] - q[j]) / max(1, abs(q[j])) for p, q in zip(cross, o['cross'])) for j in range(4)]
            brute += 1
            print('hamilton', name, ray, 'crossings', len(cross), 'of', len(o['cross']), 'tau r phi delay:', [mp.nstr(x, 2) for x in d], flush=True)
    for k in worst:
        print('worst of', count[k], k, mp.nstr(worst[k], 3))
    print('rays by brute force:', brute)


HEADER = ('spin,inclination_rad,alpha,beta,outcome,crossings,mino_total,r_min,'
          'mino_1,r_1,phi_1,delay_1,mino_2,r_2,phi_2,delay_2,mino_3,r_3,phi_3,delay_3,cond,class')
RECIPE = ('# Kerr null geodesics, backward from infinity: separated Boyer-Lindquist first integrals; Legendre integrals (polar), '
          'adaptive Gauss-Legendre quadrature (radial), mpmath %d digits, order %d, confirmed with %d digits, order %d to %s; '
          '25 digits written; inputs are exact doubles; made by kerr_crossings.py, which documents the columns')


def main():
    print(RECIPE % (MAIN[0], MAIN[1], CONFIRM[0], CONFIRM[1], AGREE))
    print(HEADER)
    kept = dropped = 0
    for name, *ray in rays():
        try:
            o = trace(ray, CONFIRM)
            d = difference(o, trace(ray, MAIN))
            if not d < mpf(AGREE):
                raise ArithmeticError('agreement only %s' % mp.nstr(d, 3))
            cond = condition(ray)
        except (ArithmeticError, ValueError, AssertionError, mp.libmp.NoConvergence) as err:
            dropped += 1
            print('left out:', name, ray, repr(err), file=sys.stderr)
            continue
        row = ['%.17g' % x for x in ray]
        row += ['escaped' if o['escaped'] else 'captured', str(o['crossings'])]

        def show(x):
            return mp.nstr(x, 25, strip_zeros=False, min_fixed=-4, max_fixed=26)
        row += [show(o['mino_total']), show(o['r_min']) if o['escaped'] else '']
        for k in range(3):
            row += [show(x) for x in o['cross'][k]] if k < len(o['cross']) else [''] * 4
        row += [mp.nstr(cond, 3), name]
        print(','.join(row), flush=True)
        kept += 1
    print('rays written: %d, left out: %d' % (kept, dropped), file=sys.stderr)


if __name__ == '__main__':
    check() if '--check' in sys.argv[1:] else main()
