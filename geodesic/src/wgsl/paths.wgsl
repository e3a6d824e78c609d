// Whole rays as the series of their steps. One invocation a ray.

// Numbers of a step, and where the rows of its series begin.
const KERR_STEP_WORDS: u32 = 72u;
const KERR_STEP_ROWS: u32 = 6u;

@group(0) @binding(2) var<storage, read> kerr_room_of: array<vec2<u32>>;  // first step of each ray, and room for how many
@group(0) @binding(3) var<storage, read_write> kerr_step_of: array<f32>;  // KERR_STEP_WORDS a step

// Keeps the terms of order j; one by one, so that no number of a loop's turn puts the series in memory.
fn kerr_store(series: ptr<function, KerrSeries>, rows: u32, j: u32) {
    let row = rows + j;
    kerr_step_of[row] = (*series).v[j];
    kerr_step_of[row + KERR_TERMS] = (*series).n[j].z;
    kerr_step_of[row + 2u * KERR_TERMS] = (*series).n[j].x;
    kerr_step_of[row + 3u * KERR_TERMS] = (*series).n[j].y;
    kerr_step_of[row + 4u * KERR_TERMS] = (*series).azimuth[j];
    kerr_step_of[row + 5u * KERR_TERMS] = (*series).time[j];
}

@compute @workgroup_size(64)
fn kerr_path(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.y * kerr_task.row + id.x;
    if k >= kerr_task.rays {
        return;
    }
    let hole = kerr_task.hole;
    let room = kerr_room_of[k];
    var walk: KerrWalk;
    var series: KerrSeries;
    let ray = kerr_begin(hole, kerr_task.place, kerr_arrive(kerr_points[k]), &walk);
    for (var step = 0u; step < room.y; step++) {
        kerr_expand(ray, walk, true, &series);
        var x = 0.0;
        let done = kerr_ends(ray, walk, &series, &x);
        let first = (room.x + step) * KERR_STEP_WORDS;
        kerr_step_of[first] = x;
        kerr_step_of[first + 1u] = walk.leg;
        kerr_step_of[first + 2u] = ray.centre;
        kerr_step_of[first + 3u] = ray.b;
        kerr_step_of[first + 4u] = select(0.0, 1.0, done);
        let rows = first + KERR_STEP_ROWS;
        kerr_store(&series, rows, 0u);
        kerr_store(&series, rows, 1u);
        kerr_store(&series, rows, 2u);
        kerr_store(&series, rows, 3u);
        kerr_store(&series, rows, 4u);
        kerr_store(&series, rows, 5u);
        kerr_store(&series, rows, 6u);
        kerr_store(&series, rows, 7u);
        kerr_store(&series, rows, 8u);
        kerr_store(&series, rows, 9u);
        kerr_store(&series, rows, 10u);
        if done {
            break;
        }
        kerr_advance(hole, ray, &walk, &series, x);
    }
}
