//! Plan of a prepared scene: what is computed, and what is left out.

use super::prepare::PreparedScene;
use crate::emission::medium::{Medium, Part};
use crate::emission::sky::SkyModel;
use kerrlight_geodesic::Method;

/// A line of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Step {
    /// Part of the plan that its cost belongs to.
    pub part: Part,
    /// Effect or quantity that is computed, or not.
    pub what: String,
    /// True if it is computed.
    pub done: bool,
}

/// Plan of a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// All steps, those that are left out too.
    pub steps: Vec<Step>,
}

impl PreparedScene {
    /// Returns the plan of its pictures.
    pub fn plan(&self) -> Plan {
        let mut plan = Plan { steps: Vec::new() };
        plan.rays(self);
        plan.layers(self);
        plan.surfaces(self);
        plan.gas(self);
        plan.volumes(self);
        plan.spots(self);
        plan.sky(self);
        plan
    }
}

impl Plan {
    fn say(&mut self, part: Part, done: bool, what: impl Into<String>) {
        self.steps.push(Step { part, what: what.into(), done });
    }

    /// One of two sentences.
    fn either(&mut self, part: Part, done: bool, [yes, no]: [&str; 2]) {
        self.say(part, done, if done { yes } else { no });
    }

    fn rays(&mut self, prepared: &PreparedScene) {
        self.say(Part::Rays, true, how(prepared));
        match prepared.request.half_orbits {
            Some(n) => self.say(Part::Rays, true, format!("light of images 0 to {n}")),
            None => self.say(Part::Rays, false, "no limit of half-orbits"),
        }
        let carried = "Stokes parameters of all emission, carried by the Walker-Penrose constant; \
                       momentum, azimuth";
        let none = "no polarisation: no Stokes parameters but I";
        self.either(Part::Rays, prepared.polarization()[0], [carried, none]);
    }

    /// Adds the needs of channels on request.
    fn layers(&mut self, prepared: &PreparedScene) {
        let wanted = prepared.optics.wanted;
        for (done, what) in [
            (wanted.orders, "images of each order apart"),
            (wanted.depth, "path length of central rays, traced once more"),
            (wanted.motion, "motion at central rays, by dual numbers"),
            (wanted.footprint, "footprints on the sky, by dual numbers"),
        ] {
            if done {
                self.say(Part::Rays, true, what);
            }
        }
    }

    fn surfaces(&mut self, prepared: &PreparedScene) {
        let part = Part::Surfaces;
        if let Some(disc) = &prepared.disc {
            self.say(part, true, "disc: radius, azimuth and delay at its crossings");
            let plunges = disc.plunges();
            let shift = if plunges {
                "g of circular orbits and of plunging matter, with the radial momentum"
            } else {
                "g of circular orbits from r and lambda: no momentum"
            };
            self.either(part, prepared.has_redshift(), [shift, "no redshift"]);
            let light = "light of matter that plunges inside the innermost stable orbit";
            let dark = "dark inside its inner edge: no plunging matter";
            self.either(part, plunges, [light, dark]);
        } else {
            self.say(part, false, "no disc: crossings are counted, not located");
        }
        if prepared.meshes.is_some() {
            self.say(part, true, "meshes, in a hierarchy of their triangles");
        }
    }

    fn gas(&mut self, prepared: &PreparedScene) {
        let part = Part::Gas;
        let found = prepared.media.iter().find(|medium| medium.part() == part);
        let Some(gas) = found else {
            return self.say(part, false, "no gas: no nodes between surfaces");
        };
        self.say(part, true, format!("nodes of r and theta inside r = {}", gas.sphere()));
        let nodes = prepared.optics.quantities_of(gas);
        for (name, channel, kept) in
            [("azimuth", "azimuth", nodes.azimuth), ("time", "delay", nodes.time)]
        {
            let yes = format!("{name} at the nodes, for the channel {channel}");
            let no = format!("no {name}: the gas is the same at every one");
            self.either(part, kept, [&yes, &no]);
        }
        match (prepared.has_redshift(), gas.quantities().velocity) {
            (true, true) => self.say(part, true, "g, with the radial momentum"),
            (true, false) => self.say(part, true, "g of motion in circles: no momentum"),
            (false, _) => self.say(part, false, "no redshift: no momentum"),
        }
        self.either(part, gas.absorbs(), ["optical depth at the nodes", "no optical depth"]);
    }

    fn volumes(&mut self, prepared: &PreparedScene) {
        let part = Part::Volumes;
        let volumes: Vec<&dyn Medium> =
            prepared.media.iter().filter(|medium| medium.part() == part).collect();
        if volumes.is_empty() {
            return self.say(part, false, "no volumes");
        }
        let count = volumes.len();
        self.say(
            part,
            true,
            format!("{count} volumes: nodes of r, theta and phi, and their values"),
        );
        let what = if prepared.optics.lensing {
            "nodes in occupied bricks alone, which turn with the matter"
        } else {
            "nodes inside the largest radius"
        };
        self.say(part, true, what);
        let slow = volumes.iter().any(|volume| volume.quantities().time);
        self.either(part, slow, ["emission when the light passed", "one time: no delays"]);
        let shift = ["g of the matter at each node", "no redshift: no momentum"];
        self.either(part, prepared.has_redshift(), shift);
    }

    fn spots(&mut self, prepared: &PreparedScene) {
        let (part, count) = (Part::Spots, prepared.spots.len());
        if count == 0 {
            return self.say(part, false, "no spots");
        }
        self.say(part, true, format!("{count} hot spots, in a hierarchy of their orbits' parts"));
        let sentences = ["emission when the light passed", "one time: no slow light"];
        self.either(part, prepared.optics.slow_light, sentences);
    }

    fn sky(&mut self, prepared: &PreparedScene) {
        let Some(sky) = &prepared.sky else {
            return self.say(Part::Sky, false, "no sky: no directions of escape");
        };
        let what = match sky.model() {
            SkyModel::Checker(_) => "checkered sky",
            SkyModel::Stars(_) => "stars",
            SkyModel::Catalogue(_) => "stars of a catalogue",
            SkyModel::Picture(..) => "a picture as sky",
        };
        self.say(Part::Sky, true, what);
        let beams = ["averaged over ray bundles", "no ray bundles"];
        self.either(Part::Sky, sky.is_averaged(), beams);
    }
}

/// Describes how rays are traced.
fn how(prepared: &PreparedScene) -> &'static str {
    let (tracer, request) = (&prepared.tracer, &prepared.request);
    if !prepared.optics.lensing {
        return "straight lines: lensing is off";
    }
    if tracer.device().is_some() {
        return "on a graphics device in floats; step by step on this processor next to the critical \
                curve";
    }
    match (tracer.closed_form(), request.paths) {
        (Some(_), true) => {
            "closed form on SIMD lanes; step by step next to the critical curve and where a spot, a \
             volume or a mesh can be met"
        }
        (Some(_), false) => "closed form on SIMD lanes; step by step next to the critical curve",
        (None, _) => match tracer.tracer().method() {
            Method::Taylor => "step by step, Taylor series",
            Method::Dop853 => "step by step, Runge-Kutta 8(5,3)",
            Method::Rk45 => "step by step, Runge-Kutta 5(4)",
        },
    }
}
