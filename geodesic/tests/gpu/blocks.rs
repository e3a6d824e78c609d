//! Blocks of rays with a device, against blocks without.

use crate::classes::Random;
use kerrlight_geodesic::simd::{NodeRequest, PanelRule, RayNodes};
use kerrlight_geodesic::vector::distance;
use kerrlight_geodesic::{
    BlockRequest, BlockTracer, Camera, Error, Inclination, Integrator, Kerr, Motion, Observer,
    Outcome, PathOfRay, PlaneCrossing, Quantities, RayBlock, RayDevice, RayVisitor, SphereNodes,
    TracedRay, View,
};
use std::sync::Arc;

/// Radius of the fog, in M; it fades towards it.
const RADIUS: f64 = 25.0;

/// An opaque disc from 6 to 9 M in a fog.
#[derive(Default)]
struct Scene {
    /// ∫ exp(−r/5) (1 − r/25)² (1 + cos²θ) (1 + sin θ cos φ/2) ds in front of the disc.
    fog: Vec<f64>,
    surface: Vec<Option<f64>>,
    exit: Vec<Option<[f64; 3]>>,
    outcome: Vec<Outcome>,
    stepped: usize,
    horizon: f64,
}

impl RayVisitor for Scene {
    fn is_opaque_at(&self, crossing: &PlaneCrossing) -> bool {
        (6.0..9.0).contains(&crossing.radius)
    }

    fn take_nodes(
        &mut self,
        _sphere: usize,
        number: usize,
        _ray: &TracedRay,
        _crossings: &[PlaneCrossing],
        nodes: &RayNodes<'_>,
    ) -> bool {
        let outside = |r: &f64| *r > self.horizon && r.is_finite();
        assert!(nodes.radius.iter().all(outside), "{:?}", nodes.radius);
        let places = nodes.radius.iter().zip(nodes.cos_theta).zip(nodes.azimuth);
        let shine = |((r, u), phi): ((&f64, &f64), &f64)| {
            (-r / 5.0).exp()
                * (1.0 - r / RADIUS).powi(2)
                * (1.0 + u * u)
                * (1.0 + 0.5 * (1.0 - u * u).sqrt() * phi.cos())
        };
        let fog = places.map(shine).zip(nodes.weight).map(|(light, weight)| light * weight).sum();
        self.fog.resize(self.fog.len().max(number + 1), 0.0);
        self.fog[number] = fog;
        true
    }

    fn take(
        &mut self,
        number: usize,
        ray: &TracedRay,
        crossings: &[PlaneCrossing],
        _path: Option<PathOfRay<'_>>,
    ) -> Result<(), Error> {
        let hit = crossings.iter().find(|crossing| Some(crossing.mino_time) == ray.surface);
        self.surface.push(hit.map(|hit| hit.radius));
        self.exit.push(ray.exit);
        self.outcome.push(ray.outcome);
        self.stepped += usize::from(ray.stepped);
        self.fog.resize(self.fog.len().max(number + 1), 0.0);
        Ok(())
    }
}

fn views(hole: &Kerr) -> Vec<View> {
    let inclination = |degrees| Inclination::from_degrees(degrees).unwrap();
    let camera = |radius, motion| Camera::new(hole, inclination(75.0), radius, motion).unwrap();
    vec![
        View::Screen(Observer::at_infinity(inclination(60.0))),
        View::Screen(Observer::at_radius(inclination(20.0), 1000.0).unwrap()),
        View::Camera(camera(40.0, Motion::Static)),
        View::Camera(camera(7.0, Motion::Keplerian).with_pointing(0.5, 0.2, 0.0)),
    ]
}

fn points(view: &View) -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(11);
    let reach = if view.observer().is_some() { 14.0 } else { 0.8 };
    (0..300).map(|_| (random.within(-reach, reach), random.within(-reach, reach))).unzip()
}

fn request() -> BlockRequest {
    let request = NodeRequest {
        radius: RADIUS,
        rule: PanelRule::new(10),
        split: 2,
        quantities: Quantities::ALL,
    };
    BlockRequest {
        crossings: 4,
        all_crossings: true,
        exit: true,
        nodes: vec![SphereNodes { request, finest: 2 }],
        ..BlockRequest::default()
    }
}

/// Surfaces, directions of escape and integrals along rays; devices do the work but for a few rays.
pub fn compare(device: Arc<dyn RayDevice>) {
    for spin in [0.0, 0.94] {
        let hole = Kerr::new(spin).unwrap();
        for view in views(&hole) {
            let (x, y) = points(&view);
            let see = |tracer: &BlockTracer| {
                let mut scene = Scene { horizon: hole.horizon(), ..Scene::default() };
                let mut block = RayBlock::default();
                tracer.trace(&x, &y, &request(), &mut block, &mut scene).unwrap();
                scene
            };
            // Azimuths next to the horizon have few digits in floats, and nodes in closed form lie elsewhere.
            for integrator in [Integrator::TaylorMino, Integrator::Elliptic] {
                let tracer = BlockTracer::new(hole, view, integrator, 1e-10).unwrap();
                let exact = see(&tracer);
                let found = see(&tracer.with_device(Arc::clone(&device)));
                // Where a ray goes beyond the radius of its observer is found step by step.
                let goes_on = view.observer().is_some_and(|observer| !observer.is_at_infinity());
                let escaped = found.exit.iter().flatten().count();
                let most = if goes_on { escaped + 10 } else { 10 };
                assert!(found.stepped < most, "{view:?}: {} step by step", found.stepped);
                agree((&view, integrator), &exact, &found);
            }
        }
    }
}

fn agree(view: (&View, Integrator), exact: &Scene, found: &Scene) {
    assert_eq!(exact.outcome, found.outcome);
    let mut worst = [0.0f64; 3];
    for k in 0..exact.outcome.len() {
        match (exact.surface[k], found.surface[k]) {
            (Some(a), Some(b)) => worst[0] = worst[0].max((a / b - 1.0).abs()),
            (a, b) => assert_eq!(a, b, "{view:?}: {k}"),
        }
        // Step by step rays know their ends behind surfaces as well.
        match (exact.exit[k].filter(|_| found.surface[k].is_none()), found.exit[k]) {
            (Some(a), Some(b)) => worst[1] = worst[1].max(distance(a, b)),
            (a, b) => assert_eq!(a, b, "{view:?}: {k}"),
        }
        let [a, b] = [exact.fog[k], found.fog[k]];
        worst[2] = worst[2].max((a - b).abs() / a.max(0.1));
    }
    println!(
        "{view:?}: radii {:.1e}, exits {:.1e}, integrals {:.1e}",
        worst[0], worst[1], worst[2]
    );
    assert!(worst[0] < 5e-6 && worst[1] < 1e-5 && worst[2] < 1e-4, "{view:?}: {worst:?}");
}

/// Counts nodes, and checks that each is a place outside the horizon; it asks for the finest.
struct Places {
    horizon: f64,
    most: usize,
}

impl RayVisitor for Places {
    fn take_nodes(
        &mut self,
        _sphere: usize,
        number: usize,
        _ray: &TracedRay,
        _crossings: &[PlaneCrossing],
        nodes: &RayNodes<'_>,
    ) -> bool {
        let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
        let outside = nodes.radius.iter().all(|r| *r > self.horizon);
        assert!(outside && finite(nodes.weight) && finite(nodes.delay), "{number}");
        self.most = self.most.max(nodes.radius.len());
        false
    }

    fn take(
        &mut self,
        _number: usize,
        _ray: &TracedRay,
        _crossings: &[PlaneCrossing],
        _path: Option<PathOfRay<'_>>,
    ) -> Result<(), Error> {
        Ok(())
    }
}

/// Thousands of nodes of a ray: more than software devices let one invocation place.
pub fn many_nodes(device: Arc<dyn RayDevice>) {
    let hole = Kerr::new(0.9).unwrap();
    let view = views(&hole)[0];
    let line: Vec<f64> = (0..40).map(|k| 0.3 * f64::from(k) - 6.0).collect();
    let mut wanted = request();
    wanted.nodes[0].finest = 64;
    let mut places = Places { horizon: hole.horizon(), most: 0 };
    let tracer = BlockTracer::new(hole, view, Integrator::Elliptic, 1e-5).unwrap();
    let tracer = tracer.with_device(device);
    tracer.trace(&line, &line, &wanted, &mut RayBlock::default(), &mut places).unwrap();
    assert!(places.most > 3000, "{}", places.most);
}
