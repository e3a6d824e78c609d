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
    double observer_radius;      /* above 2 and up to 1e30, or INFINITY */
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

/* How a camera moves. */
enum {
    KERRLIGHT_STATIC = 0,        /* at rest; outside the ergosphere only */
    KERRLIGHT_ZAMO = 1,          /* zero angular momentum */
    KERRLIGHT_KEPLERIAN = 2,     /* turning about the axis; a geodesic in the equatorial plane only */
    KERRLIGHT_FREE_FALL = 3      /* falling from rest at infinity */
};

/* A camera near the hole: all zero but for radius and inclination, it looks at the hole. */
typedef struct kerrlight_camera {
    double radius;               /* Boyer-Lindquist radius, outside the horizon, up to 1e30 */
    double inclination_degrees;  /* polar angle, [0, 180] */
    double azimuth;              /* radians */
    double yaw, pitch, roll;     /* to the right, then upwards, then clockwise; radians */
    int32_t motion;              /* KERRLIGHT_STATIC, ... */
} kerrlight_camera;

/* What a sky shader takes of rays, in the caller's arrays; NULL for what is not wanted. */
typedef struct kerrlight_sky_rays {
    int32_t *outcome;            /* [rays] KERRLIGHT_CAPTURED, ... */
    double *direction;           /* [rays*3] unit vector, z along the spin axis, of where on the sky
                                    the light comes from; NaN unless it escapes */
    double *blueshift;           /* [rays] frequency at the camera over that at infinity, 1 for a
                                    screen; NaN for light that comes from the horizon inside the
                                    ergosphere (captured) */
} kerrlight_sky_rays;

/*
 * Traces the rays that arrive at (x[k], y[k]), k < rays, of a camera's picture plane at distance 1
 * (x to the right, y upwards), and fills the arrays of `out`. Of `scene` a camera takes spin,
 * tolerance and integrator; with a NULL camera (x, y) are the (alpha, beta) of the scene's observer.
 * Returns KERRLIGHT_OK, or an error after which no array has been touched.
 */
int32_t kerrlight_sky(const kerrlight_scene *scene, const kerrlight_camera *camera, size_t rays,
                      const double *x, const double *y, const kerrlight_sky_rays *out);

/*
 * Frequency at infinity over that in the frame of matter on a circular equatorial orbit about +z,
 * for light with angular momentum lambda = L/E (that of a screen is -alpha sin i; p_phi of
 * kerrlight_points' momentum). Returns KERRLIGHT_OUT_OF_RANGE where there is no such orbit.
 */
int32_t kerrlight_keplerian_redshift(double spin, double radius, double lambda, double *factor);

/* `points` points of the critical curve, the edge of the shadow, on the screen at infinity. */
int32_t kerrlight_critical_curve(double spin, double inclination_degrees, size_t points,
                                 double *alpha, double *beta);

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
