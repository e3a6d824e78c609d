//! What a scene calls for: which quantities are traced and which are not, and why.

use crate::emission::medium::Part;
use crate::scene::{GasMotion, Integrator, Scene, Sky};

/// A line of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// Whose cost it is part of.
    pub part: Part,
    /// What is computed, or what is not.
    pub what: String,
    /// Whether it is computed.
    pub done: bool,
}

/// What is computed for a scene's picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// All steps, those that are left out too.
    pub steps: Vec<Step>,
}

impl Plan {
    /// The plan of a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut plan = Plan { steps: Vec::new() };
        plan.rays(scene);
        plan.surfaces(scene);
        plan.gas(scene);
        plan.volumes(scene);
        plan.spots(scene);
        plan.sky(scene);
        plan
    }

    fn say(&mut self, part: Part, done: bool, what: impl Into<String>) {
        self.steps.push(Step { part, what: what.into(), done });
    }

    fn rays(&mut self, scene: &Scene) {
        let effects = &scene.effects;
        let how = match scene.tracer.integrator {
            _ if !effects.lensing => "straight lines: lensing is off",
            Integrator::Elliptic if scene.camera.is_some() => {
                "step by step, Taylor series: a camera's rays"
            }
            Integrator::Elliptic => {
                "closed form on SIMD lanes; step by step next to the critical curve and where a \
                 spot, a volume or a mesh can be met"
            }
            Integrator::TaylorMino => "step by step, Taylor series",
            Integrator::Dop853Mino => "step by step, Runge-Kutta 8(5,3)",
            Integrator::Rk45Mino => "step by step, Runge-Kutta 5(4)",
        };
        self.say(Part::Rays, true, how);
        match effects.half_orbits {
            Some(n) => self.say(Part::Rays, true, format!("light of the first {n} half-orbits")),
            None => self.say(Part::Rays, false, "no limit of half-orbits"),
        }
        let polarized = effects.polarization;
        let what = if polarized {
            "Stokes parameters of all emission, carried by the Walker-Penrose constant; momentum, azimuth"
        } else {
            "no polarisation: no Stokes parameters but I"
        };
        self.say(Part::Rays, polarized, what);
    }

    fn surfaces(&mut self, scene: &Scene) {
        let effects = &scene.effects;
        if scene.disc.is_some() {
            self.say(Part::Surfaces, true, "disc: radius, azimuth and delay at its crossings");
            let plunges = scene.disc.as_ref().is_some_and(|disc| disc.plunging.is_some());
            let shift = if effects.redshift && plunges {
                "g of circular orbits and of matter that plunges, with the radial momentum"
            } else if effects.redshift {
                "g of circular orbits from r and lambda: no momentum"
            } else {
                "no redshift"
            };
            self.say(Part::Surfaces, effects.redshift, shift);
            let what = if plunges {
                "light of matter that plunges inside the innermost stable orbit"
            } else {
                "dark inside its inner edge: no matter that plunges"
            };
            self.say(Part::Surfaces, plunges, what);
        } else {
            self.say(Part::Surfaces, false, "no disc: crossings are counted, not sought");
        }
        if !scene.mesh.is_empty() {
            self.say(Part::Surfaces, true, "meshes, in a hierarchy of their triangles");
        }
    }

    fn gas(&mut self, scene: &Scene) {
        let Some(gas) = &scene.gas else {
            return self.say(Part::Gas, false, "no gas: no nodes between surfaces");
        };
        let effects = &scene.effects;
        let within = format!("nodes of r and theta inside r = {}", gas.outer_radius);
        self.say(Part::Gas, true, within);
        for (name, channel) in [("azimuth", "azimuth"), ("time", "delay")] {
            let kept = scene.screen.keeps(channel);
            let what = if kept {
                format!("{name} at the nodes, for the channel {channel}")
            } else {
                format!("no {name}: the gas is the same at every one")
            };
            self.say(Part::Gas, kept, what);
        }
        match (effects.redshift, gas.motion == GasMotion::FreeFall) {
            (true, true) => self.say(Part::Gas, true, "g, with the radial momentum"),
            (true, false) => self.say(Part::Gas, true, "g of motion in circles: no momentum"),
            (false, _) => self.say(Part::Gas, false, "no redshift: no momentum"),
        }
        let absorption = effects.absorption;
        let what = if absorption { "optical depth at the nodes" } else { "no optical depth" };
        self.say(Part::Gas, absorption, what);
    }

    fn volumes(&mut self, scene: &Scene) {
        let part = Part::Volumes;
        let count = scene.volume.len();
        if count == 0 {
            return self.say(part, false, "no volumes");
        }
        let what = format!("{count} volumes: nodes of r, theta and phi, and their values");
        self.say(part, true, what);
        let what = if scene.effects.lensing {
            "nodes in occupied bricks alone, which turn with the matter"
        } else {
            "nodes inside the largest radius"
        };
        self.say(part, true, what);
        let slow = scene.effects.slow_light && scene.changes();
        let what = if slow { "emission when the light passed" } else { "one time: no delays" };
        self.say(part, slow, what);
        let redshift = scene.effects.redshift;
        let what =
            if redshift { "g of circles about the axis" } else { "no redshift: no momentum" };
        self.say(part, redshift, what);
    }

    fn spots(&mut self, scene: &Scene) {
        let count = scene.spot.len();
        if count == 0 {
            return self.say(Part::Spots, false, "no spots");
        }
        let what = format!("{count} hot spots, in a hierarchy of their orbits' parts");
        self.say(Part::Spots, true, what);
        let slow = scene.effects.slow_light;
        let what = if slow { "emission when the light passed" } else { "one time: no slow light" };
        self.say(Part::Spots, slow, what);
    }

    fn sky(&mut self, scene: &Scene) {
        let Some(sky) = &scene.sky else {
            return self.say(Part::Sky, false, "no sky: no directions of escape");
        };
        let what = match sky {
            Sky::Checker(_) => "checkered sky",
            Sky::Stars(_) => "stars",
            Sky::Image(_) => "a picture as sky",
        };
        self.say(Part::Sky, true, what);
        let beams = scene.effects.ray_bundles;
        let what = if beams { "averaged over ray bundles" } else { "no ray bundles" };
        self.say(Part::Sky, beams, what);
    }
}
