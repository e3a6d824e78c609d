//! A scene of the recovered matter, with its motion: `kerrlight render` and `kerrlight movie` show it.

use super::Estimate;
use crate::plain;
use anyhow::Context;
use kerrlight_common::frames::Frames;
use kerrlight_common::toml_file;
use kerrlight_render::dynamics::Velocity;
use kerrlight_render::scene::{Scene, VolumeRegion};
use kerrlight_render::volume::VolumeFile;
use kerrlight_tomo::fit::{Region, Sampling, State, Trainer, flight, setup};
use kerrlight_tomo::recovery::carried;

/// The scene, and the volume that it names.
const SCENE: &str = "scene.toml";
const VOLUME: &str = "scene.npz";
/// Pixels along each side of its picture.
const SIDE: usize = 256;
/// Knots of a velocity that is written number by number, at equal ratios of radii.
const KNOTS: i32 = 257;

impl Estimate<'_> {
    /// Writes both; none for a field of events, which is not carried along by matter. Each frame of the movie has the
    /// `quiescent` light as well.
    pub fn scene(
        &self,
        trainer: &mut Trainer<'_, f32>,
        state: &State<f32>,
        movie: &Frames<f32>,
        quiescent: &[f32],
    ) -> anyhow::Result<()> {
        if trainer.representation.dimension() != 3 {
            return Ok(());
        }
        let frame = self.frame_of_still();
        let all = |image: &[f32]| image.iter().map(|x| f64::from(*x)).sum::<f64>();
        let flux = all(&movie.image(frame)?) - all(quiescent);
        let (heading, place) = (self.heading()?, self.place(frame)?);
        let parts = [heading, place, self.screen(flux)?, self.light(), self.volume(state)?];
        let text = parts.join("\n");
        // A fit may see from where a scene cannot.
        if let Err(error) = Scene::parse(&text) {
            eprintln!("note: no {SCENE} is written: {error}");
            return Ok(());
        }
        let axis = state.now.axis;
        let volume = carried(self.file, trainer, state)?;
        let file = VolumeFile { volume, axis: Some(axis.vector()) };
        self.folder.file(VOLUME)?.write(&file.to_npz())?;
        self.folder.file(SCENE)?.write(text.as_bytes())
    }

    /// The frame whose time is nearest to that of the still image.
    fn frame_of_still(&self) -> usize {
        let (times, wanted) = (&self.measured.times, self.time_of_still());
        let far = |k: &usize| (times[*k] - wanted).abs();
        (0..times.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0)
    }

    fn heading(&self) -> anyhow::Result<String> {
        let (folder, later) = (plain::quoted(&plain::path(self.folder.path())), self.later()?);
        let times: Vec<f64> = self.measured.times.iter().map(|time| time + later).collect();
        let mut text = format!(
            "# The emission that a fit recovered, with its motion. The fit: {}\n#   kerrlight render {folder}/{SCENE}\n",
            plain::line(&self.file.title)
        );
        if let [first, .., last] = times[..] {
            let span = format!("--frames {} --from {first:?} --to {last:?}", times.len());
            text += &format!(
                "#   kerrlight movie {folder}/{SCENE} {span} --set screen.width=128 -o {folder}/frames --gif {folder}/movie.gif\n"
            );
        }
        text += "# Emission is linear between the nodes of the volume (output.nodes of the fit).\n";
        text += match self.file.region.nodes {
            Sampling::Gauss { .. } => {
                "# Rays are integrated adaptively: where the picture differs from movie.npz, region.nodes of the fit are too few.\n"
            }
            Sampling::EqualMinoTime { .. } => {
                "# The fit's pixels are sums over chords (region.nodes = equal-mino-time), this scene's are integrals.\n"
            }
        };
        let angle = self.file.observer.position_angle_deg.value();
        if angle != 0.0 {
            text += &format!(
                "# The projected spin points upwards here; in the fit's images it is at {angle} degrees east of north.\n"
            );
        }
        if self.file.quiescent.is_some() {
            text += "# The quiescent light of the fit is not part of it.\n";
        }
        if self.file.polarization.is_some() {
            text += "# Light has the Doppler factor of the fit's [polarization], without what depends on the field.\n";
        }
        if self.file.effects.absorption.is_some() {
            text += "# The medium of the fit's effects.absorption is not part of scenes: this one is without it.\n";
        }
        Ok(text)
    }

    /// What scenes count of the way of light, and times of frames leave out, M.
    fn later(&self) -> anyhow::Result<f64> {
        let is_slow = self.file.effects.slow_light;
        let observer = setup::observer(&self.file.observer)?;
        Ok(if is_slow { flight(observer.inverse_radius()) } else { 0.0 })
    }

    /// Hole and observer.
    fn place(&self, frame: usize) -> anyhow::Result<String> {
        let (hole, observer) = (&self.file.hole, &self.file.observer);
        let time = self.measured.times.get(frame).context("no frame")? + self.later()?;
        let mut text = format!("[hole]\nspin = {:?}\n", hole.spin.value());
        text += &line("mass_msun", hole.mass_msun);
        text += &line("distance_kpc", hole.distance_kpc);
        text +=
            &format!("\n[observer]\ninclination_deg = {:?}\n", observer.inclination_deg.value());
        text += &line("radius", observer.radius);
        Ok(format!("{text}time = {time:?}               # of frame {frame}, M\n"))
    }

    /// The field of the fit; `flux` is that of its matter at the time of the picture, Jy.
    fn screen(&self, flux: f64) -> anyhow::Result<String> {
        let screen = &self.file.screen;
        let field = setup::spacing(screen)? * screen.pixels as f64;
        let mut text = format!(
            "[screen]\nfield_of_view_m = {field:?}\nwidth = {SIDE}                # {} in the fit\n",
            screen.pixels
        );
        let hole = &self.file.hole;
        let on_sky = hole.mass_msun.is_some() && hole.distance_kpc.is_some();
        if on_sky && screen.field_uas.is_none() && flux > 0.0 {
            text += &format!(
                "total_flux_jy = {flux:?}    # of the fit's frame; without this line intensities are Jy in a pixel of the fit\n"
            );
        }
        Ok(text)
    }

    fn light(&self) -> String {
        let effects = &self.file.effects;
        let polarized = self.file.polarization.as_ref().map(|law| law.redshift_power);
        let shift = effects.redshift_power.or(polarized);
        let shift = shift.map(|power| format!("redshift = true\nredshift_power = {power:?}\n"));
        format!(
            "[effects]\n{}slow_light = {}\n\n[tracer]\nintegrator = \"elliptic\"\ntolerance = 1e-4          # cells of the volume are larger than what a finer one would show\n",
            shift.unwrap_or_default(),
            effects.slow_light
        )
    }

    fn volume(&self, state: &State<f32>) -> anyhow::Result<String> {
        let (motion, region) = (&self.file.motion, &self.file.region);
        let law = toml_file::inline(&self.rotation()?).context("motion.velocity")?;
        let region =
            VolumeRegion { r_min: region.r_min, r_max: region.r_max, z_width: region.z_width };
        let region = toml_file::inline(&region).context("region")?;
        let mut text = format!(
            "[[volume]]\npath = \"{VOLUME}\"\nfactor = {:?}              # Jy in a pixel of the fit for 1 M of emission 1\naxis = {:?}\nrotation = {law}\nreference_time = {:?}\n",
            self.file.screen.jy_per_pixel,
            state.now.axis.vector(),
            motion.reference_time
        );
        text += &line("injection_time", motion.injection_time);
        Ok(format!("{text}region = {region}\n"))
    }

    /// The velocity of the matter: the fit's law, or numbers where a [band] has found another multiple of it.
    fn rotation(&self) -> anyhow::Result<Velocity> {
        let found = &self.motion.velocity;
        if setup::motion(self.file, Vec::new())?.velocity == *found {
            // The scene has to drag as the fit did, and to perturb from the same seed.
            let drag = setup::drag(self.file)?;
            return Ok(self.file.motion.law().seeded(self.file.seed).dragged(drag));
        }
        let Region { r_min, r_max, .. } = self.file.region.limits();
        // Matter at the edge of the region comes from beyond it where it falls.
        let (low, high) = (r_min.max(1.0), 1.5 * r_max);
        let ratio = (high / low).ln() / f64::from(KNOTS - 1);
        let radii: Vec<f64> = (0..KNOTS).map(|k| low * (ratio * f64::from(k)).exp()).collect();
        let angular = radii.iter().map(|r| found.rate(*r)).collect();
        // Profiles fall at all radii or at none: circles outside of falling matter fall by next to nothing.
        let falls: Vec<f64> = radii.iter().map(|r| found.fall(*r)).collect();
        let least = if falls.iter().any(|fall| *fall < 0.0) { -1e-12 } else { 0.0 };
        let radial = falls.iter().map(|fall| if *fall == 0.0 { least } else { *fall }).collect();
        Ok(Velocity::Profile { radii, angular, radial })
    }
}

/// `key = value`, if there is one.
fn line(key: &str, value: Option<f64>) -> String {
    value.map_or(String::new(), |value| format!("{key} = {value:?}\n"))
}
