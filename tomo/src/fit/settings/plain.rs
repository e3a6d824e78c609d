//! Settings from what only their user knows. All else is assumed; every number can be changed.

use super::{
    AxisSearch, DataFiles, Effects, FitFile, Hole, Kind, Linear, Loss, LossKind, Motion, Movie,
    Observer, Output, Quantity, Region, Representation, Screen, Simulation, Start, Training, Truth,
    WidthOf,
};
use crate::fit::{BatchSize, OccupancySettings, Sampling};
use crate::representation::{Activation, Degree};
use kerrlight_render::dynamics::Velocity;
use std::path::PathBuf;

/// Emission that fills the region, from which the scale of images is taken: small beside 1, the unit of emission.
const FILLING: f64 = 0.02;

impl Hole {
    /// A hole of spin a (M) or a prior of it, whose mass and distance do not matter: images in M, times in M.
    pub fn new(spin: impl Into<Quantity>) -> Self {
        Self { spin: spin.into(), mass_msun: None, distance_kpc: None }
    }

    /// Sgr A* (GRAVITY Collaboration 2019, A&A 625, L10).
    pub fn sgr_a_star(spin: impl Into<Quantity>) -> Self {
        Self { spin: spin.into(), mass_msun: Some(4.154e6), distance_kpc: Some(8.178) }
    }

    /// M87* (Event Horizon Telescope Collaboration 2019, ApJL 875, L6).
    pub fn m87_star(spin: impl Into<Quantity>) -> Self {
        Self { spin: spin.into(), mass_msun: Some(6.5e9), distance_kpc: Some(16_800.0) }
    }
}

impl Loss {
    /// All data of a kind, with weight 1.
    pub fn new(data: LossKind) -> Self {
        Self { data, weight: 1.0, sigma: None, stokes: None, least_snr: None }
    }
}

impl FitFile {
    /// Emission on circular orbits about the hole, seen from infinity with slow light and redshift of a flat spectrum,
    /// between two radii (M), as a representation of this kind. What is compared has yet to be said:
    /// [`simulating`](Self::simulating), [`with_images`](Self::with_images) or
    /// [`with_visibilities`](Self::with_visibilities).
    pub fn new(
        hole: Hole,
        inclination_deg: impl Into<Quantity>,
        [r_min, r_max]: [f64; 2],
        kind: Kind,
    ) -> Self {
        let start = match kind {
            Kind::LinearGrid => Start::Drawn,
            _ => Start::Linear { nodes: 36, stride: 2, steps: 2500, iterations: Some(80) },
        };
        let inclination_deg = inclination_deg.into();
        let observer = Observer { inclination_deg, position_angle_deg: 0.0.into(), radius: None };
        let nodes = Sampling::Gauss { order: 12, split: 1 };
        let velocity = Velocity::Keplerian { drag: None };
        Self {
            title: String::new(),
            seed: 1,
            hole,
            observer,
            screen: Screen {
                pixels: 32,
                width: 2.4 * r_max,
                width_of: WidthOf::Edges,
                field_uas: None,
                jy_per_pixel: 1.0,
                ring_rays: None,
                samples_per_pixel: None,
                pulse: None,
            },
            region: Region { r_min, r_max, z_width: None, nodes },
            effects: Effects { slow_light: true, redshift_power: Some(2.0), absorption: None },
            motion: Motion {
                velocity,
                axis: Some([0.0, 0.0, 1.0]),
                reference_time: 0.0,
                injection_time: None,
            },
            polarization: None,
            held_out: None,
            change: None,
            quiescent: None,
            simulation: None,
            data: None,
            search: None,
            instrument: None,
            loss: Vec::new(),
            representation: Representation {
                activation: Activation::Softplus,
                ..Representation::of(kind)
            },
            training: Training::starting(start),
            linear: Some(Linear::below(3.0)),
            axis: AxisSearch::default(),
            band: None,
            output: Output::default(),
        }
    }

    /// The same, compared with the images that `truth` gives at times from `from` to `to` (M), whose pixels have errors
    /// of `sigma` (Jy).
    #[must_use]
    pub fn simulating(self, truth: Truth, frames: usize, from: f64, to: f64, sigma: f64) -> Self {
        let loss = vec![Loss { sigma: Some(sigma), ..Loss::new(LossKind::Image) }];
        let simulation = Some(Simulation::movie(truth, Movie { frames, from, to }));
        Self { simulation, data: None, loss, ..self }
    }

    /// The same, compared with images at times from `from` to `to` (M), whose pixels have errors of `sigma` (Jy). The
    /// brightest image has `flux_jy`.
    #[must_use]
    pub fn with_images(
        mut self,
        pixels: usize,
        [from, to]: [f64; 2],
        flux_jy: f64,
        sigma: f64,
    ) -> Self {
        self.screen.pixels = pixels;
        self.loss = vec![Loss { sigma: Some(sigma), ..Loss::new(LossKind::Image) }];
        self.simulation = None;
        self.data = Some(DataFiles::Movie { path: PathBuf::new(), from, to });
        self.scaled_to(flux_jy)
    }

    /// The same, compared with complex visibilities, averaged over `average_s`, of a source of about `flux_jy`.
    #[must_use]
    pub fn with_visibilities(mut self, average_s: f64, flux_jy: f64) -> Self {
        self.simulation = None;
        self.data = Some(DataFiles::Visibilities {
            path: PathBuf::new(),
            average_s,
            systematic: 0.0,
            first_time: 0.0,
            uv_min: None,
            scattering: None,
            variability: None,
        });
        self.loss = vec![Loss::new(LossKind::Visibilities)];
        self.scaled_to(flux_jy)
    }

    /// Scales emission that fills the region, of which a ray sees 4 M, to this flux.
    fn scaled_to(mut self, flux_jy: f64) -> Self {
        let pixels = self.screen.pixels.pow(2) as f64;
        self.screen.jy_per_pixel = flux_jy / (pixels * 4.0 * FILLING);
        self
    }
}

impl Training {
    /// The usual steps from a start, with a mask of what shines where that shows what does.
    pub fn starting(start: Start) -> Self {
        let occupancy = (start != Start::Drawn).then(OccupancySettings::default);
        Self { batch: BatchSize::All, start, occupancy, ..Self::default() }
    }
}

impl Linear {
    /// Cubic splines below this emission, without penalties.
    pub fn below(upper: f64) -> Self {
        Self {
            upper,
            flux_jy: None,
            smoothness: 0.0,
            sparsity: 0.0,
            prior: None,
            degree: Degree::Cubic,
            rounds: 4,
            iterations: 200,
        }
    }
}
