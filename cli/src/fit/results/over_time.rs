//! The emission at the times of the frames: what changes while matter carries it is not told by one volume.

use super::Estimate;
use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_render::volume::{OverTime, Volume};
use kerrlight_tomo::fit::{State, Trainer};
use kerrlight_tomo::recovery::{recovered_at, true_volume};

/// Emission in the region over time.
pub struct Changes {
    /// Times of the frames, M.
    pub times: Vec<f64>,
    /// ∫ e dV of the recovered field, M³.
    pub recovered: Vec<f64>,
    /// The same of the true one, if it is known.
    pub truth: Option<Vec<f64>>,
    /// Distance of the two.
    pub closeness: OverTime,
}

impl Estimate<'_> {
    /// Returns the changes of emission that may change, or does in the truth; none where matter carries it.
    pub fn changes(
        &self,
        trainer: &mut Trainer<'_, f32>,
        state: &State<f32>,
    ) -> anyhow::Result<Option<Changes>> {
        let known = self.measured.truth.as_ref();
        if self.file.change.is_none() && known.is_none_or(|truth| truth.is_carried()) {
            return Ok(None);
        }
        let times = self.measured.times.clone();
        let mut found = Changes {
            times: times.clone(),
            recovered: Vec::new(),
            truth: known.map(|_| Vec::new()),
            closeness: OverTime::default(),
        };
        for time in times {
            let since = time - self.motion.reference;
            let volume = recovered_at(self.file, trainer, self.motion, state, since)?;
            found.recovered.push(integral(&volume));
            if let (Some(truth), Some(curve)) = (known, &mut found.truth) {
                let truth = true_volume(self.file, truth, since)?;
                curve.push(integral(&truth));
                found.closeness.add(&volume, &truth)?;
            }
        }
        Ok(Some(found))
    }
}

/// ∫ e dV, M³.
fn integral(volume: &Volume) -> f64 {
    let sum: f64 = volume.values().iter().map(|x| f64::from(*x)).sum();
    sum * volume.spacing().iter().product::<f64>()
}

impl Changes {
    /// A row a frame.
    pub fn table(&self) -> String {
        let head = "# time in GM/c^3; integral of emission over the volume in (GM/c^2)^3\n";
        let names =
            if self.truth.is_some() { "time,recovered,truth\n" } else { "time,recovered\n" };
        let row = |k: usize| {
            let truth = self.truth.as_ref().map(|truth| format!(",{:.6e}", truth[k]));
            let (time, recovered) = (self.times[k], self.recovered[k]);
            format!("{time:.6},{recovered:.6e}{}\n", truth.unwrap_or_default())
        };
        let rows: String = (0..self.times.len()).map(row).collect();
        format!("{head}{names}{rows}")
    }

    /// The same as a curve.
    pub fn plot(&self) -> LinePlot {
        let points =
            |values: &[f64]| self.times.iter().zip(values).map(|(t, x)| [*t, *x]).collect();
        let mut all = vec![Series::new("recovered", points(&self.recovered), Marks::Line)];
        let truth = self.truth.as_ref();
        all.extend(truth.map(|truth| Series::new("truth", points(truth), Marks::Points)));
        LinePlot {
            title: "Emission over time".to_owned(),
            caption: "All emission in the volume at the time of each frame. Matter carries emission; where this curve rises, emission appears, where it falls, emission fades or leaves the volume.".to_owned(),
            x: Axis::new("time", "GM/c³"),
            y: Axis::new("integral of emission", "(GM/c²)³"),
            series: all,
        }
    }
}
