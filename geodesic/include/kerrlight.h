/*
 * kerrlight.h - null geodesics of the Kerr spacetime, from C.
 *
 * Units G = c = M = 1; angles in radians but for the inclination; azimuths are unwrapped from the
 * observer's on; Mino time grows backward along the ray. A photon that arrives at (alpha, beta) has
 * Bardeen's constants of motion: alpha grows to the right (towards +phi), beta upwards.
 *
 * Build:  cargo rustc --release -p kerrlight-geodesic --features capi --crate-type staticlib
 *         cc program.c -I geodesic/include target/release/libkerrlight_geodesic.a -lpthread -ldl -lm
 * (or --crate-type cdylib for a shared library; --no-default-features --features capi for one
 * that starts no threads).
 *
 * Every function may be called from several threads at once. None of them lets a panic out,
 * keeps a pointer, or allocates anything that the caller would have to free.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef KERRLIGHT_H
#define KERRLIGHT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What functions return. */
enum {
    KERRLIGHT_OK = 0,
    KERRLIGHT_NULL_POINTER = 1,  /* a pointer is null or misaligned that must not be */
    KERRLIGHT_OUT_OF_RANGE = 2,  /* a number is not allowed; the message names it */
    KERRLIGHT_NO_ROOM = 3,       /* a stride is smaller than what is asked for */
    KERRLIGHT_INTERNAL = 4       /* a bug in the library; please report the message */
};

/* What became of a ray followed backward from the observer. */
enum {
    KERRLIGHT_CAPTURED = 0,      /* it reaches the horizon */
    KERRLIGHT_ESCAPED = 1,       /* it returns to infinity */
    KERRLIGHT_PHOTON_ORBIT = 2,  /* unresolved: on the critical curve within rounding */
    KERRLIGHT_STEP_LIMIT = 3     /* unresolved: given up after too many steps */
};

/* How rays are traced. */
enum {
    KERRLIGHT_TAYLOR_MINO = 0,   /* the fastest of those that step */
    KERRLIGHT_DOP853_MINO = 1,
    KERRLIGHT_RK45_MINO = 2,
    KERRLIGHT_RK45_AFFINE = 3,   /* only in libraries built with the feature `affine` */
    KERRLIGHT_ELLIPTIC = 4       /* closed form: by far the fastest for crossings and for samples
                                    at equal Mino times; steps where it has no digits */
};

/* Where rays are sampled. */
enum {
    KERRLIGHT_NOWHERE = 0,
    KERRLIGHT_MINO_TIME = 1,     /* `points` equidistant in Mino time along the whole ray */
    KERRLIGHT_PATH_LENGTH = 2,   /* `points` pieces of equal length inside radius `to` */
    KERRLIGHT_GAUSS_LEGENDRE = 3 /* `points` nodes on each passage between `from` and `to` */
};

/* The hole, the observer, and how rays are traced. */
typedef struct kerrlight_scene {
    double spin;                 /* [-1, 1] */
    double inclination_degrees;  /* [0, 180]; 0, 90 and 180 are exact */
    double observer_radius;      /* above 2, or INFINITY */
    double tolerance;            /* [1e-14, 1e-2] */
    int32_t integrator;          /* KERRLIGHT_TAYLOR_MINO, ... */
} kerrlight_scene;

/* Where rays are sampled; all zero for nowhere. */
typedef struct kerrlight_placement {
    int32_t kind;                /* KERRLIGHT_NOWHERE, ... */
    size_t points;
    double from;                 /* smaller radius; KERRLIGHT_GAUSS_LEGENDRE only */
    double to;                   /* radius of the sphere, or larger radius */
} kerrlight_placement;

/*
 * Points of rays in the caller's arrays. Ray k has the places k*stride to k*stride + count[k] - 1;
 * the places behind them up to (k+1)*stride are set to NaN. A column that is NULL is not
 * wanted, and what is not wanted is not integrated.
 */
typedef struct kerrlight_points {
    size_t stride;               /* room for each ray: see kerrlight_trace */
    uint32_t *count;             /* [rays] */
    double *mino_time;           /* [rays*stride] */
    double *radius;              /* [rays*stride] Boyer-Lindquist radius */
    double *theta;               /* [rays*stride] polar angle */
    double *azimuth;             /* [rays*stride] */
    double *delay;               /* [rays*stride] how much earlier the light was there */
    double *momentum;            /* [rays*stride*4] covariant (p_t, p_r, p_theta, p_phi) */
    double *weight;              /* [rays*stride] in integrals over the affine parameter;
                                    of samples only */
} kerrlight_points;

/* What is known about rays, in the caller's arrays; NULL for what is not wanted. */
typedef struct kerrlight_rays {
    int32_t *outcome;            /* [rays] KERRLIGHT_CAPTURED, ... */
    double *mino_total;          /* [rays] to the ray's end; NaN where unresolved */
    double *turning_radius;      /* [rays] NaN where the ray does not turn */
    uint32_t *crossing_count;    /* [rays] of the equatorial plane: all of them */
    double *uncertainty;         /* [rays*4] largest estimated errors of the points: of r
                                    (relative), theta, azimuth, delay */
    kerrlight_points crossings;  /* the first `stride` crossings of the equatorial plane */
    kerrlight_points samples;
} kerrlight_rays;

/*
 * Traces the rays that arrive at (alpha[k], beta[k]), k < rays, and fills the arrays of `out`, on
 * all cores unless the library was built without threads. `placement` may be NULL: no samples.
 * samples.stride must be at least placement->points, twice that for KERRLIGHT_GAUSS_LEGENDRE (a
 * ray passes between two radii up to twice). Returns KERRLIGHT_OK, or an error after which no
 * array has been touched.
 */
int32_t kerrlight_trace(const kerrlight_scene *scene, size_t rays, const double *alpha,
                        const double *beta, const kerrlight_placement *placement,
                        const kerrlight_rays *out);

/*
 * Copies the message of this thread's last error into buffer[0..size-1], cut and ended by 0 as
 * needed, and returns the length of the whole message without the 0. With size 0 buffer may be
 * NULL.
 */
size_t kerrlight_last_error(char *buffer, size_t size);

/* The library's version, "major.minor.patch". Valid for ever. */
const char *kerrlight_version(void);

#ifdef __cplusplus
}
#endif

#endif /* KERRLIGHT_H */
