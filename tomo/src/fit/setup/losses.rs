//! The terms of the loss.

use super::imported::FILE;
use super::polarized::images;
use super::{FitData, Result};
use crate::fit::settings::{FitError, Loss, LossKind, Within, refuse};
use crate::fit::{Data, FrameTerm, ImageTerm, LightCurveTerm, Scan, ScanTerm, Weighted};
use kerrlight_common::frames::Frames;
use kerrlight_common::memory;
use kerrlight_vlbi::Error as VlbiError;
use kerrlight_vlbi::data_terms::{
    AmplitudeTerm, ClosureTerm, DataTerm, DataTermError, GainTerm, VisibilityTerm,
};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{Float, ImageGrid, Method, Transform};
use kerrlight_vlbi::products::{ClosureCount, ClosureKind};

impl FitData {
    /// The terms of the loss, of images of so many pixels.
    ///
    /// # Errors
    /// If there are none, one has no data, or a number is out of range.
    pub fn terms(&self, losses: &[Loss], pixels: usize) -> Result<Data<f32>> {
        let mut data = Data { image: None, others: Vec::new() };
        if losses.is_empty() {
            refuse!(
                "loss is empty: there is nothing to fit; add a table [[loss]] with `data = …` ({}) and `weight = 1.0`",
                LossKind::NAMES.map(|(_, name, _)| name).join(", ")
            );
        }
        for (k, loss) in losses.iter().enumerate() {
            let name = || format!("loss {k}");
            if !(loss.weight > 0.0 && loss.weight.is_finite()) {
                refuse!("loss {k}: weight = {} is not allowed: above 0", loss.weight);
            }
            let weight = loss.weight;
            match loss.data {
                LossKind::Image if data.image.is_some() => {
                    refuse!("loss {k}: there is already a loss of images")
                }
                LossKind::Image => {
                    let term = Box::new(self.image(loss, pixels).within(name())?);
                    data.image = Some(Weighted { weight, term });
                }
                _ => {
                    let term = self.other(loss, pixels, images(losses)).within(name())?;
                    data.others.push(Weighted { weight, term });
                }
            }
        }
        Ok(data)
    }

    fn movie(&self) -> Result<&Frames<f64>> {
        let missing = || FitError::Conflict("there are no images, only visibilities".to_owned());
        Ok(self.movie.as_ref().ok_or_else(missing)?)
    }

    /// Flux of every frame, Jy.
    fn fluxes(&self) -> Result<Vec<f64>> {
        Ok(self.movie()?.sums()?)
    }

    fn image(&self, loss: &Loss, pixels: usize) -> Result<ImageTerm<f32>> {
        let sigma = loss.sigma.ok_or_else(|| {
            FitError::missing(
                "sigma",
                "give `sigma = …`, the standard deviation of a pixel in Jy, beside `data = \"image\"`",
            )
        })?;
        let movie = self.movie()?;
        if movie.pixels() != pixels {
            refuse!("images of {} pixels, where there are {pixels}", movie.pixels());
        }
        ImageTerm::of(movie.clone(), sigma)
    }

    /// Another term, of frames of so many images.
    fn other(&self, loss: &Loss, pixels: usize, images: usize) -> Result<Box<dyn FrameTerm<f32>>> {
        if let Some(curve) = &self.curve {
            return Ok(Box::new(curve.fitted()?));
        }
        if loss.data == LossKind::LightCurve {
            let sigma = loss.sigma.ok_or_else(|| {
                FitError::missing(
                    "sigma",
                    "give `sigma = …`, the standard deviation of the total flux in Jy, beside `data = \"light-curve\"`",
                )
            })?;
            let flux: Vec<f64> = self.fluxes()?;
            let sigmas = vec![sigma; flux.len()];
            return Ok(Box::new(LightCurveTerm::new(flux, &sigmas, pixels)?.first_of(images)));
        }
        Ok(Box::new(self.scans(loss, images * pixels)?))
    }

    /// The visibilities of all frames (of so many pixels), or what is made of them, in any precision.
    fn scans<T: Float>(&self, loss: &Loss, pixels: usize) -> Result<ScanTerm<T>> {
        let name = loss.data.label();
        let quadratic = loss.data.is_visibilities() && self.gains.is_none();
        let scans: Vec<Option<Scan<T>>> =
            (0..self.times.len()).map(|frame| self.scan(frame, loss)).collect::<Result<_>>()?;
        if scans.iter().all(Option::is_none) {
            refuse!("no frame has any {name}{}", self.torn(loss));
        }
        Ok(ScanTerm::new(name, pixels, quadratic, scans))
    }

    /// Explains why there are no closure quantities where averages of scans have them.
    fn torn(&self, loss: &Loss) -> String {
        let kind = match loss.data {
            LossKind::ClosurePhases => ClosureKind::Phase,
            LossKind::LogClosureAmplitudes => ClosureKind::LogAmplitude,
            _ => return String::new(),
        };
        let seen = self.visibilities.as_ref();
        let count = seen.map(|(seen, _)| ClosureCount::of(seen, kind, 0.0));
        let of_scans = count.and_then(|count| count.of_scans);
        of_scans.map_or(String::new(), |of_scans| {
            format!(
                ", while averages of scans have {of_scans}: baselines of a scan have different times; set average_s"
            )
        })
    }

    /// The terms of losses of visibilities, of images of so many pixels, in any precision.
    ///
    /// # Errors
    /// If one has no data.
    pub fn visibility_terms<T: Float>(
        &self,
        losses: &[Loss],
        pixels: usize,
    ) -> Result<Vec<Weighted<dyn FrameTerm<T>>>> {
        let one = |(k, loss): (usize, &Loss)| -> Result<Weighted<dyn FrameTerm<T>>> {
            let pixels = images(core::slice::from_ref(loss)) * pixels;
            let term = Box::new(self.scans(loss, pixels).within(format!("loss {k}"))?);
            Ok(Weighted { weight: loss.weight, term })
        };
        losses.iter().enumerate().map(one).collect()
    }

    fn scan<T: Float>(&self, frame: usize, loss: &Loss) -> Result<Option<Scan<T>>> {
        if loss.data.is_polarized() {
            return self.polarized_scan(frame, loss);
        }
        let (part, sky) = self.part(frame)?;
        if part.stokes_i().next().is_none() {
            return Ok(None);
        }
        let Some(term) = self.scan_data(loss, &part)? else { return Ok(None) };
        let transform = self.transform(&part, sky)?;
        Ok(Some(Scan { transform, term }))
    }

    /// Returns the transform from an image of the sky to the visibilities of a frame's rows that have
    /// Stokes I.
    pub(super) fn transform<T: Float>(
        &self,
        part: &Observation,
        sky: ImageGrid,
    ) -> Result<Transform<T>> {
        let uv: Vec<[f64; 2]> = part.stokes_i().map(|(row, _)| row.uv).collect();
        // With the same result, whether they are kept or not.
        let share = memory::part(1.0 / 8.0) / self.times.len() as f64;
        let memory = MEMORY.min(share as usize);
        Ok(Transform::new(sky, self.pulse, &[uv], Method::Direct, memory)?)
    }

    /// The rows of a frame, and where pixels are.
    pub(super) fn part(&self, frame: usize) -> Result<(Observation, ImageGrid)> {
        let missing = || {
            FitError::Conflict(format!(
                "there are no visibilities: give {FILE}, or a truth and an [observation] of it (`kerrlight fit --init` \
                 writes an example)"
            ))
        };
        let (observation, frames) = self.visibilities.as_ref().ok_or_else(missing)?;
        let sky = self.sky.ok_or_else(missing)?;
        let rows = observation.rows.iter().zip(frames).filter(|(_, of)| **of == frame);
        let rows: Vec<_> = rows.map(|(row, _)| *row).collect();
        Ok((Observation { rows, ..observation.clone() }, sky))
    }

    /// The data of a scan that a loss compares; none where closure quantities have too few baselines.
    fn scan_data<T: Float>(&self, loss: &Loss, part: &Observation) -> Result<Option<ScanData<T>>> {
        let least = loss.least_snr.unwrap_or(0.0);
        let kind = match (loss.data, &self.gains) {
            (LossKind::Visibilities, Some(priors)) => {
                return Ok(Some(Box::new(GainTerm::visibilities(part, priors)?)));
            }
            (LossKind::Amplitudes, Some(priors)) => {
                return Ok(Some(Box::new(GainTerm::amplitudes(part, priors)?)));
            }
            (LossKind::Visibilities, None) => {
                return Ok(Some(Box::new(VisibilityTerm::new(part)?)));
            }
            (LossKind::Amplitudes, None) => return Ok(Some(Box::new(AmplitudeTerm::new(part)?))),
            (LossKind::ClosurePhases, _) => ClosureKind::Phase,
            (LossKind::LogClosureAmplitudes, _) => ClosureKind::LogAmplitude,
            (other, _) => refuse!("{} are not made of visibilities of Stokes I", other.label()),
        };
        match ClosureTerm::new(part, kind, least) {
            Err(VlbiError::DataTerm(DataTermError::Empty)) => Ok(None),
            term => Ok(Some(Box::new(term?))),
        }
    }
}

/// Data of a scan.
type ScanData<T> = Box<dyn DataTerm<T> + Send>;

/// Exponentials of a frame up to this many bytes are kept.
pub(super) const MEMORY: usize = 8 << 20;
