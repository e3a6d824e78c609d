/*
 * A sky shader in letters: what a camera sees of a sky of stripes behind a hole, how much brighter
 * the light arrives, and the width of the shadow.
 *
 *   cargo rustc --release -p kerrlight-geodesic --features capi --crate-type staticlib
 *   cc geodesic/examples/c/sky.c -I geodesic/include \
 *      target/release/libkerrlight_geodesic.a -lpthread -ldl -lm -o sky && ./sky
 */
#include "kerrlight.h"

#include <math.h>
#include <stdio.h>

enum { ROWS = 21, COLUMNS = 61, RAYS = ROWS * COLUMNS, POINTS = 360 };

static int failed(const char *what)
{
    char message[256];
    kerrlight_last_error(message, sizeof message);
    fprintf(stderr, "%s: %s\n", what, message);
    return 1;
}

int main(void)
{
    kerrlight_scene scene = {0.9, 0.0, INFINITY, 1e-8, KERRLIGHT_TAYLOR_MINO};
    kerrlight_camera camera = {.radius = 12.0, .inclination_degrees = 85.0,
                               .motion = KERRLIGHT_FREE_FALL};
    static double x[RAYS], y[RAYS], direction[3 * RAYS], blueshift[RAYS];
    static int32_t outcome[RAYS];
    for (int k = 0; k < RAYS; k++) {
        x[k] = 0.04 * (k % COLUMNS - COLUMNS / 2);
        y[k] = 0.08 * (ROWS / 2 - k / COLUMNS);
    }
    kerrlight_sky_rays sky = {outcome, direction, blueshift};
    if (kerrlight_sky(&scene, &camera, RAYS, x, y, &sky) != KERRLIGHT_OK)
        return failed("sky");
    for (int k = 0; k < RAYS; k++) {
        double azimuth = atan2(direction[3 * k + 1], direction[3 * k]);
        int stripe = (int)floor(azimuth / 0.3);
        putchar(outcome[k] != KERRLIGHT_ESCAPED ? ' ' : stripe % 2 ? '#' : '.');
        if (k % COLUMNS == COLUMNS - 1)
            putchar('\n');
    }
    printf("ahead the light is shifted by %.6f\n", blueshift[RAYS / 2]);

    double alpha[POINTS], beta[POINTS], left = 0.0, right = 0.0, factor;
    if (kerrlight_critical_curve(0.9, 85.0, POINTS, alpha, beta) != KERRLIGHT_OK)
        return failed("critical curve");
    for (int k = 0; k < POINTS; k++) {
        left = fmin(left, alpha[k]);
        right = fmax(right, alpha[k]);
    }
    printf("the shadow is %.4f M wide\n", right - left);
    if (kerrlight_keplerian_redshift(0.9, 6.0, 4.0, &factor) != KERRLIGHT_OK)
        return failed("redshift");
    printf("light of an orbit at 6 M arrives with %.6f of its frequency\n", factor);
    return 0;
}
