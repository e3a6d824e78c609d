//! Settings of a static image: of a source that does not change while it is observed. No hole, no gas and no motion
//! are assumed.

mod penalties;
mod polarization;

pub use penalties::{PenaltyKind, PenaltySettings};
pub use polarization::StaticPolarization;

use crate::Error;
use kerrlight_common::toml_file::Keys;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::linear::Prior;
use kerrlight_tomo::fit::settings::{
    FitError, InstrumentSettings, Loss, LossKind, Scattering, Variability, Within, check_losses,
    check_ranges, read, refuse,
};
use kerrlight_vlbi::operator::ImageGrid;
use penalties::priors_of;
use polarization::check_strength;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::LazyLock;

static KEYS: LazyLock<Keys> = LazyLock::new(Keys::of::<StaticImageFile>);

/// The settings of a fit of a static image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticImageFile {
    /// Title of the report, one line.
    pub title: String,
    /// Seed of all random draws.
    pub seed: u64,
    /// The static image: nothing is assumed of a hole, and nothing moves.
    pub image: ImageSettings,
    /// Measured data.
    pub data: StaticData,
    /// Instrumental parameters that are fitted with the image.
    pub instrument: Option<InstrumentSettings>,
    /// Terms of the loss: visibilities, amplitudes and closure quantities.
    pub loss: Vec<Loss>,
    /// Penalties on the brightness over its mean; lengths are parts of the field.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regulariser: Vec<PenaltySettings>,
    /// Light that is expected in the middle of the field.
    pub envelope: Option<EnvelopeSettings>,
    /// A factor on all penalties, chosen by cross-validation; 1 without it.
    pub strength: Option<StrengthSettings>,
    /// Measures a ring in the image.
    pub ring: Option<RingSettings>,
    /// Fits linear polarisation as well.
    pub polarization: Option<StaticPolarization>,
}

/// Pixels of a static image, its flux, and how it is looked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageSettings {
    /// Pixels along each side.
    #[schemars(range(min = 8, max = 512), extend("unit" = "pixels along a side"))]
    pub pixels: usize,
    /// Width of the square field, µas.
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    pub field_uas: f64,
    /// Mean of the Gaussian prior of the flux, Jy.
    #[schemars(range(min = 1e-12, max = 1e9), extend("unit" = "Jy"))]
    pub flux_jy: f64,
    /// Its standard deviation, Jy.
    #[schemars(range(min = 1e-12, max = 1e9), extend("unit" = "Jy"))]
    pub flux_sigma_jy: f64,
    /// Images to start from; the fit ends with the one of the least loss.
    pub starts: Vec<StartImage>,
    /// Iterations from one start, at most.
    #[schemars(range(min = 1, max = 1_000_000), extend("unit" = "iterations"))]
    pub iterations: usize,
    /// Fits of the image measured once more with other noise, and half as many of a simple shape, two at least, which give errors; needs a
    /// loss of amplitudes or visibilities.
    #[schemars(range(min = 2, max = 1000), extend("unit" = "draws"))]
    pub draws: Option<usize>,
}

/// An image to start from, in the middle of the field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum StartImage {
    /// A circle with a Gaussian cross-section.
    Ring {
        /// Diameter, µas.
        #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
        diameter_uas: f64,
        /// Full width at half maximum of its cross-section, µas.
        #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
        width_uas: f64,
    },
    /// A round Gaussian.
    Gaussian {
        /// Full width at half maximum, µas.
        #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
        fwhm_uas: f64,
    },
}

/// Round light that is expected in the middle of the field: the entropy relative to it is a penalty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvelopeSettings {
    /// Full width at half maximum of a Gaussian, µas; without it, light with the second moment of the best simple shape, flat with soft edges if
    /// that is a disc, a ring or a crescent.
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    pub fwhm_uas: Option<f64>,
    /// Factor on the entropy relative to it.
    #[schemars(range(min = 1e-12, max = 1e12), extend("unit" = "a factor"))]
    pub weight: f64,
}

/// Data of a static image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticData {
    /// Visibilities of a source that does not change.
    pub visibilities: StaticVisibilities,
}

/// Visibilities of a source that does not change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticVisibilities {
    /// UVFITS, eht-imaging's text, EHT tables or CSV, relative to this file; `$KERRLIGHT_EHT_DATA/NAME` is in the
    /// folder that this variable names. Several files (bands, days) in a list make one image, each with gains of its own.
    pub path: DataPaths,
    /// Rows within this time are averaged and share the gains of their stations, s, 0 or above.
    #[schemars(range(min = 0.0), extend("unit" = "seconds"))]
    pub average_s: f64,
    /// Fraction of each amplitude, added to its error in quadrature; of each product where all four are fitted.
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "part of the amplitude"))]
    pub systematic: f64,
    /// Drops baselines shorter than this.
    #[schemars(range(min = 0.0), extend("unit" = "wavelengths"))]
    pub uv_min: Option<f64>,
    /// First and last hour of UTC, hours; all without it.
    #[schemars(inner(range(min = 0.0, max = 1000.0)), extend("unit" = "hours"))]
    pub utc_h: Option<[f64; 2]>,
    /// Interstellar scattering that is part of the model.
    pub scattering: Option<Scattering>,
    /// Adds jy/(1 + (|u|/uv)²)^(power/2) to all errors, for what the source varies.
    pub variability: Option<Variability>,
}

/// A file or several.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a path or a list of paths")]
pub enum DataPaths {
    /// One.
    One(PathBuf),
    /// Several of one source at one frequency.
    Several(Vec<PathBuf>),
}

impl DataPaths {
    /// All of them.
    pub fn all(&self) -> &[PathBuf] {
        match self {
            Self::One(path) => core::slice::from_ref(path),
            Self::Several(paths) => paths,
        }
    }

    /// Their names in a line.
    pub fn names(&self) -> String {
        self.all().iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
    }

    fn check(&self) -> Result<(), Error> {
        let paths = self.all();
        if paths.is_empty() {
            let key = "length of data.visibilities.path";
            return Err(FitError::range(key, 0, "1 file or more").into());
        }
        for (k, path) in paths.iter().enumerate() {
            if paths[..k].contains(path) {
                refuse!("data.visibilities.path: {} is given twice", path.display());
            }
        }
        Ok(())
    }
}

/// Factors on all penalties, from which frames that are held out choose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrengthSettings {
    /// Factors to choose from, two or more.
    #[schemars(inner(range(min = 1e-12, max = 1e12)), extend("unit" = "a factor"))]
    pub values: Vec<f64>,
    /// Parts of the frames, at most half of their number, each held out once.
    #[schemars(range(min = 2, max = 1000), extend("unit" = "parts of the frames"))]
    pub folds: usize,
}

/// Radii between which a ring is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RingSettings {
    /// Least distance of the brightest points from the centre, µas.
    #[schemars(range(min = 0.0, max = 1e12), extend("unit" = "microarcseconds"))]
    pub least_radius_uas: f64,
    /// Largest distance, at most half of the field, µas.
    #[schemars(range(min = 1e-6, max = 1e12), extend("unit" = "microarcseconds"))]
    pub most_radius_uas: f64,
}

impl ImageSettings {
    /// The pixels on the sky.
    ///
    /// # Errors
    /// If their number or the field is out of range.
    pub fn grid(&self) -> Result<ImageGrid, Error> {
        Ok(ImageGrid::new(self.pixels, self.pixels, self.field_uas * MICROARCSECOND)?)
    }
}

impl StaticImageFile {
    /// Settings of an image and of the data that it explains, which are handed over as an observation: without gains,
    /// penalties, ring and polarisation, which are fields to be set.
    pub fn new(image: ImageSettings, loss: Vec<Loss>) -> Self {
        let visibilities = StaticVisibilities {
            path: DataPaths::Several(Vec::new()),
            average_s: 0.0,
            systematic: 0.0,
            uv_min: None,
            utc_h: None,
            scattering: None,
            variability: None,
        };
        Self {
            title: String::new(),
            seed: 1,
            image,
            data: StaticData { visibilities },
            instrument: None,
            loss,
            regulariser: Vec::new(),
            envelope: None,
            strength: None,
            ring: None,
            polarization: None,
        }
    }

    /// All keys of such a file, with their documentation.
    pub fn keys() -> &'static Keys {
        &KEYS
    }

    /// Returns whether a fit's text asks for a static image: it has a table `image`.
    pub fn is_static_image(text: &str) -> bool {
        text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("image"))
    }

    /// The settings in a TOML text.
    ///
    /// # Errors
    /// On syntax, unknown or missing keys, wrong types, numbers out of range, and settings that contradict each other.
    ///
    /// # Examples
    /// ```
    /// # use kerrlight_imaging::settings::StaticImageFile;
    /// let error = StaticImageFile::parse("title = \"M87*\"\nseed = 1").unwrap_err();
    /// assert!(error.to_string().contains("missing field `image`"));
    /// ```
    pub fn parse(text: &str) -> Result<Self, Error> {
        let file: Self = read(text, Self::keys())?;
        file.data.visibilities.path.check()?;
        file.check()?;
        Ok(file)
    }

    /// Penalties with their weights, before the factor on all of them.
    ///
    /// # Errors
    /// If a kind occurs twice or a number is missing or out of range.
    pub fn priors(&self) -> Result<Vec<Prior>, Error> {
        priors_of(&self.regulariser)
    }

    /// Refuses settings that contradict each other.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if self.image.starts.is_empty() {
            return Err(FitError::range("length of image.starts", 0, "1 image or more").into());
        }
        if self.loss.is_empty() {
            refuse!("loss is empty: there is nothing to fit; add a table [[loss]]");
        }
        check_losses(&self.loss)?;
        for (k, loss) in self.loss.iter().enumerate() {
            loss_of_visibilities(loss).within(format!("loss {k}"))?;
        }
        self.check_penalties()?;
        self.check_ring()?;
        match &self.polarization {
            Some(polarization) => polarization.check(self),
            None if self.instrument.as_ref().is_some_and(|i| i.leakage.is_some()) => {
                refuse!(
                    "instrument.leakage needs a table [polarization]: total intensity does not know it"
                )
            }
            None => Ok(()),
        }
    }

    /// The same, and numbers out of range.
    pub(crate) fn check_all(&self) -> Result<(), Error> {
        check_ranges(self, Self::keys())?;
        self.check()
    }

    fn check_penalties(&self) -> Result<(), Error> {
        self.priors()?;
        let Some(strength) = &self.strength else { return Ok(()) };
        check_strength("", strength)?;
        if self.regulariser.is_empty() && self.envelope.is_none() {
            refuse!(
                "strength is a factor on penalties, and there is no [[regulariser]] and no [envelope]"
            );
        }
        Ok(())
    }

    fn check_ring(&self) -> Result<(), Error> {
        let Some(RingSettings { least_radius_uas, most_radius_uas }) = self.ring else {
            return Ok(());
        };
        let most = 0.5 * self.image.field_uas;
        if !(most_radius_uas > least_radius_uas && most_radius_uas <= most) {
            let allowed = format!("above ring.least_radius_uas, at most {most}, half of the field");
            return Err(FitError::range("ring.most_radius_uas", most_radius_uas, &allowed).into());
        }
        Ok(())
    }
}

fn loss_of_visibilities(loss: &Loss) -> Result<(), FitError> {
    if loss.data.is_polarized() || matches!(loss.data, LossKind::Image | LossKind::LightCurve) {
        refuse!(
            "data = {:?} is not for a static image: visibilities, amplitudes, closure-phases or log-closure-amplitudes",
            loss.data.name()
        );
    }
    if loss.sigma.is_some() || loss.stokes.is_some() {
        refuse!("sigma and stokes are not for visibilities, whose errors the data state");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::SETTINGS;

    fn text() -> String {
        format!("{SETTINGS}[strength]\nvalues = [0.1, 1.0]\nfolds = 3\n")
    }

    #[test]
    fn exact_settings_survive_being_written() {
        let file = StaticImageFile::parse(&text()).unwrap();
        let again = StaticImageFile::parse(&toml::to_string(&file).unwrap()).unwrap();
        assert_eq!(file, again);
        assert!(StaticImageFile::is_static_image(SETTINGS));
        assert!(!StaticImageFile::is_static_image("title = \"x\""));
    }

    #[test]
    fn bad_settings_are_named() {
        for (from, to, says) in [
            ("pixels = 32", "pixels = 4", "image.pixels = 4 is not allowed: 8 to 512"),
            ("flux_jy = 0.6", "flux_jy = -1.0", "image.flux_jy = -1"),
            ("diameter_uas = 50.0", "diameter_uas = 0.0", "image.starts.1.ring.diameter_uas = 0"),
            ("values = [0.1, 1.0]", "values = [0.1]", "length of strength.values = 1"),
            ("folds = 3", "folds = 1", "strength.folds = 1"),
            ("kind = \"total-variation\"", "kind = \"sparsity\"", "unknown variant `sparsity`"),
            ("epsilon = 30.0\n", "", "regulariser 0: epsilon is missing"),
            ("total-variation", "smoothness", "regulariser 0: epsilon is not for smoothness"),
            ("\"closure-phases\"", "\"image\"", "loss 1: data = \"image\" is not for"),
            ("path = \"none\"", "path = []", "length of data.visibilities.path = 0"),
            ("path = \"none\"", "path = [\"a\", \"b\", \"a\"]", "a is given twice"),
            ("path = \"none\"", "path = 3", "a path or a list of paths"),
            ("most_radius_uas = 45.0", "most_radius_uas = 70.0", "at most 60, half of the field"),
            ("[ring]", "[hole]\nspin = 0.5\n[ring]", "unknown field `hole`"),
        ] {
            assert!(text().contains(from));
            let error = StaticImageFile::parse(&text().replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    }
}
