/*
 * The shadow of a fast hole in letters, and where one ray meets the equatorial plane.
 *
 *   cargo rustc --release -p kerrlight-geodesic --features capi --crate-type staticlib
 *   cc geodesic/examples/c/shadow.c -I geodesic/include \
 *      target/release/libkerrlight_geodesic.a -lpthread -ldl -lm -o shadow && ./shadow
 */
#include "kerrlight.h"

#include <math.h>
#include <stdio.h>

enum { ROWS = 25, COLUMNS = 60, RAYS = ROWS * COLUMNS, CROSSINGS = 3 };

static int failed(const char *what)
{
    char message[256];
    kerrlight_last_error(message, sizeof message);
    fprintf(stderr, "%s: %s\n", what, message);
    return 1;
}

int main(void)
{
    kerrlight_scene scene = {0.998, 90.0, INFINITY, 1e-6, KERRLIGHT_TAYLOR_MINO};
    static double alpha[RAYS], beta[RAYS];
    static int32_t outcome[RAYS];
    static uint32_t crossings[RAYS];
    for (int k = 0; k < RAYS; k++) {
        alpha[k] = 0.25 * (k % COLUMNS) - 5.5;
        beta[k] = 6.0 - 0.5 * (k / COLUMNS);
    }
    kerrlight_rays screen = {0};
    screen.outcome = outcome;
    screen.crossing_count = crossings;
    if (kerrlight_trace(&scene, RAYS, alpha, beta, NULL, &screen) != KERRLIGHT_OK)
        return failed("shadow");
    for (int k = 0; k < RAYS; k++) {
        putchar(outcome[k] == KERRLIGHT_CAPTURED ? ' ' : crossings[k] > 1 ? 'o' : '.');
        if (k % COLUMNS == COLUMNS - 1)
            putchar('\n');
    }

    /* One ray with everything about its crossings. */
    scene.inclination_degrees = 60.0;
    scene.tolerance = 1e-12;
    double right = -5.5, up = 1.0;
    uint32_t count;
    double radius[CROSSINGS], azimuth[CROSSINGS], delay[CROSSINGS];
    kerrlight_rays one = {0};
    one.crossings.stride = CROSSINGS;
    one.crossings.count = &count;
    one.crossings.radius = radius;
    one.crossings.azimuth = azimuth;
    one.crossings.delay = delay;
    if (kerrlight_trace(&scene, 1, &right, &up, NULL, &one) != KERRLIGHT_OK)
        return failed("ray");
    for (uint32_t k = 0; k < count; k++)
        printf("r = %.15g, phi = %.15g, delay = %.15g\n", radius[k], azimuth[k], delay[k]);
    return 0;
}
