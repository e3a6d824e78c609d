//! Data that were measured: what is taken from images and visibilities.

use super::gains;
use super::leakage;
use super::observed::add_systematic;
use super::polarized::is_polarized;
use super::truth::SPOT;
use super::visibilities::{averaged, frames_of};
use super::{FitData, Result, hours_per_m, sky};
use crate::fit::settings::{
    DataFiles, FitFile, InstrumentSettings, Loss, PixelShape, Scattering, Variability, Within,
    refuse,
};
use kerrlight_common::frames::Frames;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::noise::{ScatteringKernel, unscatter};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::ImageGrid;
use kerrlight_vlbi::polarimetry::{derotate, is_turning};

/// Advice where there are no data.
pub(super) const FILE: &str = "a table [data.visibilities] or [data.movie] with `path = \"FILE\"` (`kerrlight fit --init FILE` writes \
     all of it)";

impl FitData {
    /// Refuses settings that name both a truth and data, or neither.
    ///
    /// # Errors
    /// Says what to write.
    pub fn check_origin(file: &FitFile) -> Result<()> {
        match (&file.data, &file.simulation) {
            (Some(_), Some(_)) => {
                refuse!("simulation and data exclude each other: give one of them")
            }
            (None, Some(simulation)) if simulation.kinds() > 1 => refuse!(
                "simulation.movie, simulation.observation and simulation.light_curve exclude each other: give one of them"
            ),
            (None, None) => {
                refuse!("there is neither a simulation nor data (to read): {SPOT}; or {FILE}")
            }
            _ if file.instrument.is_some() && !file.has_visibilities() => refuse!(
                "instrument needs visibilities: [data.visibilities] or [simulation.observation]"
            ),
            _ => Ok(()),
        }
    }

    /// Takes images of this width and height as the data. `name` is what the movie is called in messages.
    ///
    /// # Errors
    /// If it has other pixels than the settings, or its times are not those of images.
    pub fn of_movie(
        file: &FitFile,
        movie: Frames<f64>,
        [width, height]: [usize; 2],
        name: &str,
    ) -> Result<Self> {
        let Some(DataFiles::Movie { from, to, .. }) = file.data else {
            refuse!("images are read, and there is no [data.movie]")
        };
        let times = even_times("data.movie", movie.count(), [from, to])?;
        let n = file.screen.pixels;
        if [width, height] != [n, n] {
            refuse!("{name} has {width} x {height} pixels, but screen.pixels says {n} x {n}");
        }
        let (movie, sky) = (Some(movie), sky(file).ok());
        Ok(FitData { times, movie, sky, ..FitData::default() })
    }

    /// Takes measured visibilities as the data. `name` is what they are called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, or mass, distance or the frequency of scattered light are missing.
    pub fn of_visibilities(file: &FitFile, observation: Observation, name: &str) -> Result<Self> {
        let Some(DataFiles::Visibilities {
            average_s,
            systematic,
            first_time,
            uv_min,
            scattering,
            variability,
            ..
        }) = file.data
        else {
            refuse!("{name} holds visibilities, and there is no [data.visibilities]")
        };
        let reduction = Reduction { average_s, uv_min, systematic, scattering, variability };
        let observation = reduction.of(observation, &file.loss, name)?;
        let per_m = hours_per_m(file)?;
        let sky = sky(file)?;
        let mut all = Self::of_frames(sky, observation, &file.loss, file.instrument.as_ref())?;
        all.check_resolved()?;
        let first = all.times[0];
        all.times.iter_mut().for_each(|time| *time = first_time + (*time - first) / per_m);
        let pulse = file.screen.pulse.unwrap_or(PixelShape::Delta).pulse();
        let has_intrinsic_variability = variability.is_some();
        Ok(FitData { average_s, has_intrinsic_variability, pulse, ..all })
    }

    /// Visibilities of a sky as they are, with the gains and the leakage that a fit solves for. Times of frames are hours of
    /// UTC.
    ///
    /// # Errors
    /// If losses do not tell gains, a station has no prior, or leakage is asked of data without circular feeds.
    pub fn of_frames(
        sky: ImageGrid,
        mut observation: Observation,
        losses: &[Loss],
        instrument: Option<&InstrumentSettings>,
    ) -> Result<Self> {
        let (times, of_rows) = frames_of(&mut observation);
        let gains = gains::priors(instrument, losses, &observation)?;
        let leakage = leakage::unknown(instrument, &observation)?;
        let visibilities = Some((observation, of_rows));
        let sky = Some(sky);
        Ok(FitData { times, visibilities, sky, gains, leakage, ..FitData::default() })
    }

    /// Refuses a field across which no baseline sees the phase turn: to these data the source is a point whatever its shape.
    ///
    /// # Errors
    /// Tells the field and the longest baseline.
    pub fn check_resolved(&self) -> Result<()> {
        const LEAST_TURNS: f64 = 0.05;
        let (Some(sky), Some((observation, _))) = (self.sky, &self.visibilities) else {
            return Ok(());
        };
        let field_rad = sky.pixel_rad * sky.width.max(sky.height) as f64;
        let lengths = observation.rows.iter().map(|row| row.uv[0].hypot(row.uv[1]));
        let longest = lengths.fold(0.0, f64::max);
        if field_rad * longest < LEAST_TURNS {
            refuse!(
                "the field is {:.2e} microarcseconds wide, and the longest baseline {longest:.2e} wavelengths: phases turn by {:.1e} \
                 of a circle across it, so that nothing of its shape is in the data; look at the mass (solar masses), the distance \
                 (kpc) or the field, and whether (u, v) are wavelengths",
                field_rad / MICROARCSECOND,
                field_rad * longest,
            );
        }
        Ok(())
    }
}

/// Refuses rows of stations that there are none of, and numbers that are none: files have neither, observations that a caller
/// has made may.
fn check_rows(observation: &Observation) -> Result<()> {
    for (k, row) in observation.rows.iter().enumerate() {
        let station = row.stations.iter().find(|n| usize::from(**n) >= observation.stations.len());
        if let Some(n) = station {
            refuse!("row {k} is of station {n}, and there are {}", observation.stations.len());
        }
        let is_finite = [row.time_h, row.uv[0], row.uv[1]].iter().all(|x| x.is_finite());
        let mut products = (0..4).filter_map(|product| row.product(product));
        if !is_finite || products.any(|product| !product.visibility.is_finite()) {
            refuse!("row {k}: its time, (u, v) or a visibility is not finite");
        }
    }
    Ok(())
}

/// Reduction of measured visibilities before a model is compared with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reduction {
    /// Rows of an interval of this many seconds are averaged; 0 keeps all.
    pub average_s: f64,
    /// Baselines shorter than this many wavelengths are left out.
    pub uv_min: Option<f64>,
    /// Part of each amplitude that is added to its error in quadrature, 0 or above.
    pub systematic: f64,
    /// Scattering that is undone.
    pub scattering: Option<Scattering>,
    /// Variability of the source, which is added to errors of Stokes I in quadrature.
    pub variability: Option<Variability>,
}

impl Reduction {
    /// Averaged visibilities in order of time: Stokes I, or all products where a loss is polarised. `name` is what they are
    /// called in messages.
    ///
    /// # Errors
    /// If a visibility has no error, none is left, the frequency of scattered light is not known, polarised light would
    /// get the errors of a source that varies, or what turns with the feeds does not tell how these stand.
    pub fn of(&self, observation: Observation, losses: &[Loss], name: &str) -> Result<Observation> {
        check_rows(&observation).within(name)?;
        let mut observation = observation;
        derotate(&mut observation).within(name)?;
        // Stokes parameters of each row do not tell how they were made.
        if is_turning(&observation) && is_polarized(losses) {
            refuse!(
                "{name} says FRCAL: 0, and has Stokes parameters: give the products of the feeds, whose rotation can be taken out"
            );
        }
        if !is_polarized(losses) {
            // Rows without Stokes I take no part in its times and (u, v).
            let basis = observation.basis;
            observation.rows.retain(|row| row.stokes_i(basis).is_some());
        }
        let mut observation = averaged(observation, self.average_s, self.uv_min).within(name)?;
        if !is_polarized(losses) {
            observation = observation.total_intensity();
        }
        observation.sort();
        add_systematic("data.visibilities.systematic", self.systematic, &mut observation, losses)?;
        self.correct(&mut observation, losses, name)?;
        Ok(observation)
    }

    /// Undoes scattering, then adds to errors what the source varies.
    fn correct(&self, observation: &mut Observation, losses: &[Loss], name: &str) -> Result<()> {
        if self.scattering == Some(Scattering::SgrA) {
            unscatter(observation, &ScatteringKernel::sgr_a()).within(name)?;
        }
        // That of the source itself, which scattering has not dimmed.
        let Some(variability) = self.variability else { return Ok(()) };
        if is_polarized(losses) {
            refuse!(
                "data.visibilities.variability is that of total intensity: it is not for polarized-visibilities or \
                 polarimetric-ratios"
            );
        }
        // Rows of total intensity have one product, the first.
        for row in &mut observation.rows {
            let sigma = variability.sigma(row.uv[0].hypot(row.uv[1]));
            row.noise_sigma[0] = row.noise_sigma[0].hypot(sigma);
        }
        Ok(())
    }
}

/// Times of frames at equal steps, M; `key` is the table that says the first and the last.
pub(super) fn even_times(key: &str, frames: usize, [from, to]: [f64; 2]) -> Result<Vec<f64>> {
    if !(from.is_finite() && to.is_finite() && (frames == 1 || to > from)) {
        refuse!("{key}: from = {from}, to = {to} are not allowed: from must be below to");
    }
    // A single frame is at `from`.
    let step = (to - from) / (frames.max(2) - 1) as f64;
    Ok((0..frames).map(|k| from + step * k as f64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::settings::{Hole, Kind};
    use kerrlight_vlbi::Complex64;
    use kerrlight_vlbi::array::Station;
    use kerrlight_vlbi::observation::{Basis, Measured, Row};
    use kerrlight_vlbi::operator::Pulse;

    /// 1 Jy on one baseline at these hours, with (u, v).
    fn observed(rows: &[(f64, [f64; 2])]) -> Observation {
        let mut observation = Observation::empty(Basis::Stokes);
        observation.stations = ["A", "B"].map(Station::named).to_vec();
        let i = Measured { visibility: Complex64::new(1.0, 0.0), noise_sigma: 0.1 };
        let row = |(time_h, uv): &(f64, [f64; 2])| Row::total_intensity(*time_h, [0, 1], *uv, i);
        observation.rows = rows.iter().map(row).collect();
        observation
    }

    /// A minute is 60 s/(G M/c³), with 20.4605 s of Sgr A*; pixels are points unless the settings say what they are.
    #[test]
    fn exact_times_and_pixels_of_measured_visibilities() {
        let hole = Hole::sgr_a_star(0.0);
        let settings = FitFile::new(hole, 30.0, [2.0, 10.0], Kind::LinearGrid);
        let mut file = settings.with_visibilities(0.0, 2.4);
        if let Some(DataFiles::Visibilities { first_time, .. }) = &mut file.data {
            *first_time = 5.0;
        }
        let observation = observed(&[4.0, 4.0 + 1.0 / 60.0].map(|time_h| (time_h, [1e9, 0.0])));
        let data = FitData::of_visibilities(&file, observation.clone(), "a test").unwrap();
        assert_eq!((data.times.len(), data.times[0], data.pulse), (2, 5.0, Pulse::Delta));
        assert!((data.times[1] - 5.0 - 60.0 / 20.460_49).abs() < 1e-5, "{:?}", data.times);
        file.screen.pulse = Some(PixelShape::Rectangle);
        let data = FitData::of_visibilities(&file, observation, "a test").unwrap();
        assert_eq!(data.pulse, Pulse::Rectangle);
    }

    /// A mass without its 10⁶, or (u, v) in Gλ: 120 µas are 6e-10 rad.
    #[test]
    fn exact_a_field_that_no_baseline_resolves_is_refused() {
        let sky = ImageGrid::new(8, 8, 120.0 * MICROARCSECOND).unwrap();
        let data = |longest: f64| {
            let observation = observed(&[(4.0, [0.6 * longest, 0.8 * longest])]);
            let data = FitData::of_frames(sky, observation, &[], None).unwrap();
            data.check_resolved().map_err(|e| e.to_string())
        };
        assert_eq!(data(8e9), Ok(()));
        let refused = data(8.0).unwrap_err();
        assert!(
            refused.contains("1.20e2 microarcseconds wide, and the longest baseline 8.00e0"),
            "{refused}"
        );
    }
}
