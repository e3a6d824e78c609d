//! The data of a fit: simulated, or read from files.

use crate::interferometry::{self, arguments, movie_files};
use crate::output;
use crate::paths;
use anyhow::{Context, bail};
use kerrlight_common::frames::Frames;
use kerrlight_common::numpy;
use kerrlight_common::units::{MICROARCSECOND, gravitational_time};
use kerrlight_imaging::data as imaging;
use kerrlight_imaging::settings::{StaticImageFile, StrengthSettings};
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::settings::{DataFiles, FitFile, Simulation};
use kerrlight_tomo::fit::setup::{self, Drawn, FitData, Instrument};
use kerrlight_validation::sky::{Screen, Sky};
use kerrlight_vlbi::files;
use kerrlight_vlbi::files::images::{OwnTimes, WithSize, npy_frames, npz_facts, npz_frames};
use kerrlight_vlbi::light_curve::LightCurve;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::ImageGrid;
use kerrlight_vlbi::simulate::Movie;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Simulates or reads the data; relative paths start from `base_dir`.
pub fn measure(
    file: &FitFile,
    instrument: &Instrument,
    base_dir: &Path,
) -> anyhow::Result<FitData> {
    match &file.data {
        None => {
            let file = &with_times(file, base_dir)?;
            let array = file.observation().map(|seen| {
                arguments::array_near(&seen.array, base_dir).context("simulation.observation.array")
            });
            Ok(FitData::simulated_by(&sky, file, instrument, array.transpose()?.as_ref())?)
        }
        Some(DataFiles::Movie { path, .. }) => {
            let path = base_dir.join(path);
            let (movie, size) = images(file, &path)?;
            Ok(FitData::of_movie(file, movie, size, &path.display().to_string())?)
        }
        Some(DataFiles::LightCurve(settings)) => {
            let path = paths::of_data(&settings.path, base_dir)?;
            let name = path.display().to_string();
            Ok(FitData::of_light_curve(file, light_curve(&path)?, &name)?)
        }
        Some(DataFiles::Visibilities { path, .. }) => {
            let of = |observation, name: &str| FitData::of_visibilities(file, observation, name);
            visibilities(&paths::of_data(path, base_dir)?, of)
        }
    }
}

/// A drawn geometry as the program's second forward model sees it.
fn sky(
    drawn: &Drawn<'_>,
    emission: &(dyn Fn([f64; 3]) -> f64 + Sync),
) -> Result<Vec<Vec<f64>>, Error> {
    let sky = Sky {
        spin: drawn.spin,
        inclination_deg: drawn.inclination.to_degrees(),
        position_angle_deg: drawn.position_angle.to_degrees(),
        power: drawn.redshift_power,
        radii: drawn.radii,
        height: drawn.height,
    };
    let screen = Screen { width: drawn.width, pixels: drawn.pixels, rays: 1 };
    let at = |[rho, phi, z]: [f64; 3]| emission([rho * phi.cos(), rho * phi.sin(), z]);
    Ok(sky.movie(screen, drawn.times, at)?)
}

/// A light curve of a table, or of the baselines within a site of a UVFITS file.
fn light_curve(path: &Path) -> anyhow::Result<LightCurve> {
    let name = || path.display().to_string();
    if !matches!(paths::ending(path).as_str(), "uvfits" | "fits") {
        return files::parse_light_curve(&output::read_text(path)?).with_context(name);
    }
    let observation = interferometry::read(path)?;
    interferometry::warn_of_repeats(&name(), &observation);
    let curve = LightCurve::of_sites(&observation.with_repeats_merged());
    if curve.samples.is_empty() {
        bail!("{}: no baseline lies within a site", name());
    }
    if let Some(part) = LightCurve::incoherent_part(&observation) {
        bail!(
            "{}: {:.0} % of the power on baselines within a site is imaginary: their phases are not calibrated, and their real parts are no fluxes",
            name(),
            100.0 * part
        );
    }
    Ok(curve)
}

/// The settings with the times of a simulated light curve, where these are in a file.
fn with_times(file: &FitFile, base_dir: &Path) -> anyhow::Result<FitFile> {
    let mut file = file.clone();
    let Some(Simulation { light_curve: Some(curve), .. }) = &mut file.simulation else {
        return Ok(file);
    };
    let Some(path) = curve.times.take() else { return Ok(file) };
    if curve.times_h.is_some() {
        bail!("simulation.light_curve.times and times_h exclude each other");
    }
    let path = base_dir.join(path);
    let times = files::parse_times(&output::read_text(&path)?);
    curve.times_h = Some(times.with_context(|| path.display().to_string())?);
    Ok(file)
}

/// The images of a file or of a sequence of files, none of which need to be in memory together, with width and height.
fn images(file: &FitFile, path: &Path) -> anyhow::Result<WithSize> {
    let files = movie_files::files(path)?;
    if files.len() > 1 {
        return sequence(file, &files);
    }
    let name = || path.display().to_string();
    match paths::ending(path).as_str() {
        "npz" => {
            let (field, times) =
                npz_facts(BufReader::new(output::open(path)?)).with_context(name)?;
            check_times(file, path, &times)?;
            let (frames, [width, height]) =
                npz_frames(output::read_through(path)?).with_context(name)?;
            if let Some(field) = field {
                let own = ImageGrid::new(width, height, field * MICROARCSECOND);
                setup::check_field(file, own.with_context(name)?, &name())?;
            }
            Ok((frames, [width, height]))
        }
        // In Fortran order no image lies in one piece: such an array is read as a whole.
        "npy" if numpy::Stream::new(BufReader::new(output::open(path)?)).is_ok() => {
            npy_frames(output::read_through(path)?).with_context(name)
        }
        _ => {
            let (Movie { grid, pixels }, _) = movie(file, &files[0])?;
            Ok((Frames::of(pixels, grid.pixels()), [grid.width, grid.height]))
        }
    }
}

/// An image a file.
fn sequence(file: &FitFile, files: &[PathBuf]) -> anyhow::Result<WithSize> {
    let (first, _) = movie(file, &files[0])?;
    let size = [first.grid.width, first.grid.height];
    // Frames know errors of files alone: what is wrong with an image is kept aside.
    let (mut refused, mut hours) = (None, Vec::new());
    let frames = Frames::made(files.len(), first.grid.pixels(), |sink| {
        files.iter().try_for_each(|path| match one(file, path, size) {
            Ok((pixels, own)) => {
                hours.extend(own);
                sink(&pixels)
            }
            Err(error) => {
                refused = Some(error);
                Err(std::io::Error::other("no image").into())
            }
        })
    });
    if let Some(error) = refused {
        return Err(error);
    }
    let name = || files[0].display().to_string();
    let times = match hours.len() == files.len() {
        true => OwnTimes::Since(hours),
        false => OwnTimes::Unknown,
    };
    movie_files::check_steps(&times).with_context(name)?;
    check_times(file, &files[0], &times)?;
    Ok((frames?, size))
}

/// The image of a file, of this width and height, with its time, where it tells one.
fn one(
    file: &FitFile,
    path: &Path,
    [width, height]: [usize; 2],
) -> anyhow::Result<(Vec<f64>, Option<f64>)> {
    let (image, times) = movie(file, path)?;
    if [image.grid.width, image.grid.height] != [width, height] || image.frames() != 1 {
        let path = path.display();
        bail!("{path}: in a sequence every file is one image of {width} x {height} pixels");
    }
    let own = match times {
        OwnTimes::Since(hours) => hours.first().copied(),
        _ => None,
    };
    Ok((image.pixels, own))
}

/// The movie of a file, which may know its field, and its times.
fn movie(file: &FitFile, path: &Path) -> anyhow::Result<(Movie, OwnTimes)> {
    let files = [path.to_owned()];
    let (movie, times) = match movie_files::read(&files, None) {
        Ok(known) => known,
        Err(first) => {
            // Only pixels and their number are used: any field serves where none is given. Of files that have one, which a field
            // that is given offends, the first error is the one.
            let field = file.screen.field_uas.unwrap_or(1.0);
            let (movie, times) = movie_files::read(&files, Some(field)).map_err(|second| {
                if second.to_string().starts_with("--fov-uas") { first } else { second }
            })?;
            return Ok((movie.i, times));
        }
    };
    setup::check_field(file, movie.i.grid, &path.display().to_string())?;
    check_times(file, path, &times)?;
    Ok((movie.i, times))
}

/// Refuses images that are at other times than those of the fit by more than a hundredth.
fn check_times(file: &FitFile, path: &Path, times: &OwnTimes) -> anyhow::Result<()> {
    let (OwnTimes::Utc(hours) | OwnTimes::Since(hours)) = times else { return Ok(()) };
    let ([first, .., last], Some(mass), Some([from, to])) =
        (&hours[..], file.hole.mass_msun, file.span_of_images())
    else {
        return Ok(());
    };
    let (own, fit) = (last - first, (to - from) * gravitational_time(mass) / 3600.0);
    if (own - fit).abs() > 0.01 * own.abs().max(fit.abs()) {
        bail!(
            "{} says that its images are over {own:.4} hours, and the fit's are over {fit:.4}: data.movie.from and to, M, \
             at the mass of the hole (`hours` or `times` of an archive: rename what is none)",
            path.display()
        );
    }
    Ok(())
}

/// The data of a static image, and those of its polarisation, where that is asked for.
pub fn of_static(
    file: &StaticImageFile,
    base_dir: &Path,
) -> anyhow::Result<(FitData, Option<FitData>)> {
    let (mut all, mut all_polarized) = (Vec::new(), Vec::new());
    for path in file.data.visibilities.path.all() {
        let path = paths::of_data(path, base_dir)?;
        let (measured, polarized) = visibilities(&path, |observation, name| {
            let polarized = imaging::polarized(file, observation.clone(), name)?;
            Ok((imaging::total_intensity(file, observation, name)?, polarized))
        })?;
        let name = || path.display().to_string();
        all.push((name(), measured));
        all_polarized.extend(polarized.map(|polarized| (name(), polarized)));
    }
    let of = file.polarization.as_ref().map(|polarization| &polarization.strength);
    let joined = |strength: &Option<StrengthSettings>| {
        imaging::joined(all_polarized, "polarization.", strength.as_ref())
    };
    let polarized = of.map(joined).transpose()?;
    Ok((imaging::joined(all, "", file.strength.as_ref())?, polarized))
}

fn visibilities<R>(
    path: &Path,
    of: impl FnOnce(Observation, &str) -> Result<R, Error>,
) -> anyhow::Result<R> {
    let observation = interferometry::read(path)?;
    let (name, all) = (path.display().to_string(), observation.rows.len());
    let without = all - observation.stokes_i().count();
    interferometry::warn_of_repeats(&name, &observation);
    interferometry::note_cautions(&name, &observation);
    let measured = of(observation, &name)?;
    if without > 0 {
        eprintln!(
            "{name}: {without} of {all} rows have no parallel hands and tell no total intensity"
        );
    }
    Ok(measured)
}
