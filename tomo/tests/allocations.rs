//! Batches of a size that a workspace has seen allocate nothing.

use kerrlight_tomo::optimise::AdamState;
use kerrlight_tomo::representation::{
    Activation, Coordinates, CoordinatesMut, FeatureGrid, FeatureGridSettings, Gradient, Grid,
    GridSettings, Groups, Network, NetworkSettings, Representation, Workspace,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands everything to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller vouches.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller vouches.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const POINTS: usize = 5000;

fn allocations(representation: &dyn Representation<f32>) -> usize {
    let column = |k: usize| (0..POINTS).map(|i| (i * k % 101) as f32 / 10.0 - 5.0).collect();
    let [x, y, z, cotangents]: [Vec<f32>; 4] = [3, 7, 11, 13].map(column);
    let (mut values, mut of_points) = (vec![0.0; POINTS], [(); 3].map(|()| vec![0.0; POINTS]));
    let mut parameters = vec![0.0; representation.parameters()];
    representation.initialise(1, &mut parameters);
    let mut gradient = vec![0.0; parameters.len()];
    let (mut workspace, mut state) = (Workspace::new(), AdamState::new(parameters.len()));
    let starts: Vec<usize> = (0..=50).map(|k| k * 100).collect();
    let link = |_: core::ops::Range<usize>, v: &[f32], c: &mut [f32]| c.copy_from_slice(v);
    let groups = Groups { starts: &starts, link: &link };
    let mut round = || {
        let at = Coordinates::xyz(&x, &y, &z);
        let [a, b, c] = &mut of_points;
        let coordinates = Some(CoordinatesMut::xyz(a, b, c));
        representation.eval(&parameters, at, &mut values, &mut workspace);
        let into = Gradient { parameters: &mut gradient, coordinates };
        representation.vjp(&parameters, at, &cotangents, into, &mut workspace);
        let into = Gradient { parameters: &mut gradient, coordinates: None };
        representation.eval_vjp(&parameters, at, groups, &mut values, into, &mut workspace);
        state.step(1e-3, &gradient, &mut parameters);
        ALLOCATIONS.load(Ordering::Relaxed)
    };
    let first = round();
    let warm = round();
    assert!(warm == first, "the second round allocates {}", warm - first);
    let last = (0..5).map(|_| round()).max().expect("a count");
    last - warm
}

#[test]
fn batches_of_a_known_size_allocate_nothing() {
    let network = Network::new(NetworkSettings::bhnerf()).expect("the paper's sizes");
    let (nodes, low, high) = ([32; 3], [-5.0; 3], [5.0; 3]);
    let activation = Activation::Sigmoid;
    let grid = Grid::new(GridSettings { nodes, low, high, activation, initial: -10.0 });
    let grid = grid.expect("a grid");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    let (coarsest, levels, initial) = (4, 3, -4.0);
    let features =
        FeatureGrid::new(FeatureGridSettings { coarsest, levels, low, high, activation, initial });
    let features = features.expect("grids");
    for representation in [&network as &dyn Representation<f32>, &grid, &features] {
        assert_eq!(pool.install(|| allocations(representation)), 0);
    }
}
