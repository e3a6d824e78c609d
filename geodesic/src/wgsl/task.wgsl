// What is traced, and where it comes from.

struct KerrTask {
    hole: KerrHole,
    place: KerrPlace,
    lens: KerrLens,
    rays: u32,
    crossings: u32,    // room for each ray's crossings
    samples: u32,      // of each ray, equidistant in Mino time
    camera: u32,       // 1: points are (x, y) of the lens; 0: (alpha, beta)
    row: u32,          // invocations in a row of the grid
    quadratures: u32,  // 1: azimuths and delays are wanted
    sphere: f32,       // 1/r of a sphere: the Mino times at which rays enter and leave it are wanted; 0 for none
    pad: u32,
}

@group(0) @binding(0) var<uniform> kerr_task: KerrTask;
@group(0) @binding(1) var<storage, read> kerr_points: array<vec4<f32>>;

fn kerr_arrive(point: vec4<f32>) -> KerrPhoton {
    if kerr_task.camera != 0u {
        return kerr_through_lens(kerr_task.hole, kerr_task.place, kerr_task.lens, point.xz, point.yw);
    }
    return kerr_on_screen(kerr_task.hole, kerr_task.place, point.xz, point.yw);
}
