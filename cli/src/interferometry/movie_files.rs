//! Movies of one file or of many, and when their images show the source.

use super::arguments;
use super::image_files::{self, OwnTimes};
use crate::{output, paths};
use anyhow::{Context, anyhow, bail};
use kerrlight_vlbi::simulate::StokesMovie;
use std::path::{Path, PathBuf};

/// Times of a movie's images.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameTimes {
    /// Image k at scan k.
    Scans,
    /// Times in the files.
    Own,
    /// Hours of UTC of the first image and of the last, equal steps between.
    Hours([f64; 2]),
    /// A file with an hour of UTC a line.
    File(PathBuf),
}

/// `scans`, `own`, `FROM-TO` or the name of a file.
pub fn frame_times(text: &str) -> Result<FrameTimes, String> {
    Ok(match (text, arguments::range(text)) {
        ("scans", _) => FrameTimes::Scans,
        ("own", _) => FrameTimes::Own,
        (_, Ok(hours)) => FrameTimes::Hours(hours),
        _ => FrameTimes::File(PathBuf::from(text)),
    })
}

/// The files that an argument stands for: itself, the images in a folder, or those of a pattern
/// with `%d`, `%04d` or one `*` in the file's name; in the order of the numbers in their names.
pub fn files(argument: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let shown = argument.display();
    let name = argument.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let pattern = Pattern::parse(name);
    // A file that exists is meant itself, even if its name looks like a pattern.
    if argument.exists() && !argument.is_dir() || !argument.is_dir() && pattern.is_none() {
        return Ok(vec![argument.to_owned()]);
    }
    let (folder, pattern) = match pattern {
        Some(pattern) if !argument.is_dir() => (paths::folder_of(argument), pattern),
        _ => (argument, Pattern { start: "", end: ".exr", digits: false }),
    };
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut names = Vec::new();
    for entry in entries {
        let name = entry?.file_name();
        names.extend(name.to_str().filter(|name| pattern.fits(name)).map(str::to_owned));
    }
    names.sort_by_cached_key(|name| numbered(name));
    match pattern.digits {
        true => pattern.no_gaps(&names)?,
        false => check_order(&names)?,
    }
    if names.is_empty() {
        bail!("{shown}: there are no files {}*{}", pattern.start, pattern.end);
    }
    Ok(names.iter().map(|name| folder.join(name)).collect())
}

/// Common parts of the names of a sequence.
struct Pattern<'a> {
    start: &'a str,
    end: &'a str,
    /// True if only digits stand between.
    digits: bool,
}

impl<'a> Pattern<'a> {
    fn parse(name: &'a str) -> Option<Self> {
        if let Some((start, end)) = name.split_once('*') {
            return Some(Pattern { start, end, digits: false });
        }
        let (start, rest) = name.split_once('%')?;
        let end = rest.trim_start_matches(|c: char| c.is_ascii_digit()).strip_prefix('d')?;
        Some(Pattern { start, end, digits: true })
    }

    fn middle<'n>(&self, name: &'n str) -> Option<&'n str> {
        let rest = name.strip_prefix(self.start)?;
        let (middle, end) = rest.split_at_checked(rest.len().checked_sub(self.end.len())?)?;
        // `f_2.EXR` between `f_1.exr` and `f_3.exr` is a frame.
        end.eq_ignore_ascii_case(self.end).then_some(middle)
    }

    fn fits(&self, name: &str) -> bool {
        let digits = |m: &str| !m.is_empty() && m.bytes().all(|b| b.is_ascii_digit());
        // Hidden files are being written, or were left behind.
        !name.starts_with('.') && self.middle(name).is_some_and(|m| !self.digits || digits(m))
    }

    /// Refuses numbers that are missing or there twice.
    fn no_gaps(&self, names: &[String]) -> anyhow::Result<()> {
        let number = |name: &String| self.middle(name).and_then(|m| m.parse::<u64>().ok());
        for pair in names.windows(2) {
            if number(&pair[0]).and_then(|k| k.checked_add(1)) != number(&pair[1]) {
                bail!("{} is followed by {}: a frame is missing or doubled", pair[0], pair[1]);
            }
        }
        Ok(())
    }
}

/// Sorts files whose names differ by a whole number alone by it; others, decimals among them, keep their order.
pub fn sort_by_numbers(files: &mut [PathBuf]) {
    let names: Vec<_> = files.iter().map(|file| numbered(&file.to_string_lossy())).collect();
    let Some(first) = names.first() else { return };
    let are_alike = |name: &Vec<(u128, String)>| {
        name.len() == first.len() && name.iter().zip(first).all(|(a, b)| a.1 == b.1)
    };
    if !names.iter().all(are_alike) {
        return;
    }
    let differs = |k: &usize| names.iter().any(|name| name[*k].0 != first[*k].0);
    if let [only] = (0..first.len()).filter(differs).collect::<Vec<_>>()[..] {
        let is_decimal = only > 1 && first[only - 1].1 == ".";
        let name = |file: &PathBuf| file.to_string_lossy().into_owned();
        let mut sorted: Vec<String> = files.iter().map(name).collect();
        sorted.sort_by_cached_key(|name| numbered(name));
        if !is_decimal && check_order(&sorted).is_ok() {
            files.sort_by_cached_key(|file| numbered(&file.to_string_lossy()));
        }
    }
}

/// A name for sorting, runs of digits as numbers: `frame_9` comes before `frame_10`.
fn numbered(name: &str) -> Vec<(u128, String)> {
    let mut parts: Vec<(u128, String)> = vec![(0, String::new())];
    let mut in_digits = false;
    for c in name.chars() {
        match (c.to_digit(10), in_digits) {
            (Some(digit), true) => {
                if let Some((number, _)) = parts.last_mut() {
                    *number = number.saturating_mul(10).saturating_add(digit.into());
                }
            }
            (Some(digit), false) => parts.push((digit.into(), String::new())),
            (None, _) => {
                if let Some((_, text)) = parts.last_mut() {
                    text.push(c);
                }
            }
        }
        in_digits = c.is_ascii_digit();
    }
    parts
}

/// Refuses files in the order of whole numbers that would be in another one if these had decimals and signs.
fn check_order(names: &[String]) -> anyhow::Result<()> {
    let is_other = |pair: &&[String]| {
        let [(a, of_a), (b, of_b)] = [decimals(&pair[0]), decimals(&pair[1])];
        of_a == of_b && a > b
    };
    match names.windows(2).find(is_other) {
        Some([a, b]) => bail!(
            "{a}, {b}: their order is not known, since numbers may have decimals or signs: number them from 0 on, or give the files one by one to `observe`"
        ),
        _ => Ok(()),
    }
}

/// The numbers in a name, with decimals, and with the signs that do not follow a word; and what stands beside them.
fn decimals(name: &str) -> (Vec<f64>, String) {
    let bytes = name.as_bytes();
    let is_digit = |k: usize| bytes.get(k).is_some_and(u8::is_ascii_digit);
    let digits = |from: usize| (from..).find(|k| !is_digit(*k)).unwrap_or(from);
    let (mut numbers, mut others, mut k) = (Vec::new(), Vec::new(), 0);
    while k < bytes.len() {
        let is_sign = bytes[k] == b'-' && (k == 0 || !bytes[k - 1].is_ascii_alphanumeric());
        let start = k + usize::from(is_sign);
        let whole = digits(start);
        if whole == start {
            others.push(bytes[k]);
            k += 1;
            continue;
        }
        let has_point = bytes.get(whole) == Some(&b'.') && is_digit(whole + 1);
        let end = if has_point { digits(whole + 1) } else { whole };
        numbers.extend(name[k..end].parse::<f64>());
        k = end;
    }
    (numbers, String::from_utf8_lossy(&others).into_owned())
}

/// Reads a movie from its only file, or from one image a file.
pub fn read(files: &[PathBuf], fov_uas: Option<f64>) -> anyhow::Result<(StokesMovie, OwnTimes)> {
    let [first, rest @ ..] = files else { bail!("no image is given") };
    let (mut movie, mut times) = image_files::read(first, fov_uas)?;
    let is_movie = |path: &Path| {
        anyhow!("{} is a movie: in a sequence every file is one image", path.display())
    };
    if !rest.is_empty() && movie.i.frames() != 1 {
        return Err(is_movie(first));
    }
    for path in rest {
        let (image, time) = image_files::read(path, fov_uas)?;
        let (a, b) = (movie.i.grid, image.i.grid);
        let same_field = (a.pixel_rad - b.pixel_rad).abs() <= 1e-9 * a.pixel_rad;
        if (a.width, a.height) != (b.width, b.height) || !same_field {
            bail!("{} differs from {} in pixels or field", path.display(), first.display());
        }
        if image.i.frames() != 1 {
            return Err(is_movie(path));
        }
        movie.i.pixels.extend(image.i.pixels);
        for (all, one) in movie.polarized.iter_mut().zip(image.polarized) {
            match (all, one) {
                (Some(all), Some(one)) => all.extend(one),
                (None, None) => {}
                _ => bail!(
                    "{} and {} have not the same Stokes parameters",
                    path.display(),
                    first.display()
                ),
            }
        }
        times = match (times, time) {
            (OwnTimes::Since(mut all), OwnTimes::Since(one)) => {
                all.extend(one);
                OwnTimes::Since(all)
            }
            _ => OwnTimes::Unknown,
        };
    }
    Ok((movie, times))
}

/// The hour of UTC of every image, and how to say it.
pub fn times(
    frames: usize,
    own: &OwnTimes,
    choice: Option<&FrameTimes>,
    scans_h: &[f64],
) -> anyhow::Result<(Vec<f64>, String)> {
    if frames == 1 {
        return match choice {
            None => Ok((vec![0.0], "one image, seen by all scans".to_owned())),
            Some(_) => bail!("--frame-times is for movies: there is one image"),
        };
    }
    let times = match choice {
        None => return at_scans(frames, own, scans_h),
        Some(FrameTimes::Scans) if frames == scans_h.len() => scans_h.to_vec(),
        Some(FrameTimes::Scans) => {
            bail!("--frame-times scans: {frames} images, but {} scans (--frames)", scans_h.len())
        }
        Some(FrameTimes::Own) => own_hours(own, scans_h[0])?,
        Some(FrameTimes::Hours([from, to])) => {
            check_steps(own)?;
            (0..frames).map(|k| from + (to - from) * k as f64 / (frames - 1) as f64).collect()
        }
        Some(FrameTimes::File(path)) => file_hours(path)?,
    };
    if times.len() != frames {
        bail!("--frame-times: {} times for {frames} images", times.len());
    }
    let (from, to) = (times[0], times[frames - 1]);
    Ok((times, format!("{frames} images from {from} to {to} h UTC, linear between")))
}

/// Refuses images whose own times are not at equal steps, where equal steps are assumed: some are missing.
pub fn check_steps(own: &OwnTimes) -> anyhow::Result<()> {
    let (OwnTimes::Utc(hours) | OwnTimes::Since(hours)) = own else { return Ok(()) };
    let steps: Vec<f64> = hours.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let Some(first) = steps.first() else { return Ok(()) };
    match steps.iter().position(|step| (step - first).abs() > 0.01 * first.abs()) {
        Some(k) => bail!(
            "images {} and {} are {:.4} h apart by their own times, the first two {first:.4} h: some are missing",
            k + 1,
            k + 2,
            steps[k]
        ),
        None => Ok(()),
    }
}

/// Image k at scan k, unless numbers or the images' own times speak against it.
fn at_scans(frames: usize, own: &OwnTimes, scans_h: &[f64]) -> anyhow::Result<(Vec<f64>, String)> {
    if frames != scans_h.len() {
        let count = scans_h.len();
        bail!("{frames} images, but {count} scans: say when images are, with --frame-times");
    }
    let step = (scans_h[frames - 1] - scans_h[0]) / (frames - 1) as f64;
    let far = |(own, scan): (&f64, &f64)| (own - scan).abs() > 0.01 * step;
    let own = own_hours(own, scans_h[0]);
    if own.is_ok_and(|own| own.len() != frames || own.iter().zip(scans_h).any(far)) {
        bail!(
            "the images' own times are not those of the scans: say --frame-times own, or \
             --frame-times scans for image k at scan k"
        );
    }
    Ok((scans_h.to_vec(), format!("{frames} images, image k at scan k")))
}

/// Returns the hours in files; times that count from nowhere start with the first scan.
fn own_hours(own: &OwnTimes, first_scan_h: f64) -> anyhow::Result<Vec<f64>> {
    match own {
        OwnTimes::Unknown => bail!("--frame-times own: the images do not tell their times"),
        OwnTimes::Utc(hours) => Ok(hours.clone()),
        OwnTimes::Since(hours) => {
            let start = hours.first().copied().unwrap_or_default();
            Ok(hours.iter().map(|hour| first_scan_h + (hour - start)).collect())
        }
    }
}

/// An hour of UTC a line; `#` begins a comment.
fn file_hours(path: &Path) -> anyhow::Result<Vec<f64>> {
    let text = output::read_text(path).context("--frame-times")?;
    let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim()));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let hour = |(number, line): (usize, &str)| {
        let cell: String = line.chars().take(20).collect();
        let hour = line.parse().ok().filter(|hour: &f64| hour.is_finite());
        hour.with_context(|| format!("{}, line {number}: `{cell}` is no hour", path.display()))
    };
    lines.map(hour).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sequences_of_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        for name in ["f_9.exr", "f_10.exr", "f_8.exr", "g.exr", "f_11.csv", ".f_12.exr"] {
            std::fs::write(path.join(name), "").unwrap();
        }
        let names = |pattern: &str| -> Vec<String> {
            let files = files(&path.join(pattern)).unwrap();
            files.iter().map(|p| p.file_name().unwrap().to_str().unwrap().to_owned()).collect()
        };
        assert_eq!(names("f_%d.exr"), ["f_8.exr", "f_9.exr", "f_10.exr"]);
        assert_eq!(names("f_*.exr"), ["f_8.exr", "f_9.exr", "f_10.exr"]);
        assert_eq!(names(""), ["f_8.exr", "f_9.exr", "f_10.exr", "g.exr"]);
        assert_eq!(names("absent.csv"), ["absent.csv"]);
        for name in ["t_0.25.exr", "t_0.5.exr", "s_-1.exr", "s_-2.exr", "u_1.EXR", "u_2.exr"] {
            std::fs::write(path.join(name), "").unwrap();
        }
        for pattern in ["t_*.exr", "s_*.exr"] {
            let error = files(&path.join(pattern)).unwrap_err().to_string();
            assert!(error.contains("number them from 0 on"), "{error}");
        }
        assert_eq!(names("u_*.exr"), ["u_1.EXR", "u_2.exr"]);
        assert_eq!(names("s_-%d.exr"), ["s_-1.exr", "s_-2.exr"]);
        let mut given = ["s_-2.exr", "s_-1.exr"].map(PathBuf::from);
        sort_by_numbers(&mut given);
        assert_eq!(given, ["s_-2.exr", "s_-1.exr"].map(PathBuf::from));
        let numbers = decimals("v2.run-3_-4.50.exr");
        assert_eq!(numbers, (vec![2.0, 3.0, -4.5], "v.run-_.exr".to_owned()));
        assert!(files(&path.join("h_*.exr")).unwrap_err().to_string().contains("no files h_*.exr"));
        std::fs::remove_file(path.join("f_9.exr")).unwrap();
        let message = files(&path.join("f_%02d.exr")).unwrap_err().to_string();
        assert!(message.contains("f_8.exr is followed by f_10.exr"), "{message}");
    }

    /// A movie among images is refused, whether it comes first or later.
    #[test]
    fn exact_sequences_have_one_image_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let [image, movie] = ["image.npy", "movie.npy"].map(|name| folder.path().join(name));
        let array = |shape: &[u64]| {
            let values = vec![0.5; shape.iter().product::<u64>() as usize];
            kerrlight_common::numpy::write_array(shape, &values)
        };
        std::fs::write(&image, array(&[4, 4])).unwrap();
        std::fs::write(&movie, array(&[3, 4, 4])).unwrap();
        for files in [[&movie, &image], [&image, &movie]] {
            let error = read(&files.map(Clone::clone), Some(100.0)).unwrap_err().to_string();
            assert!(error.contains("movie.npy is a movie"), "{error}");
        }
        assert_eq!(read(&[image.clone(), image], Some(100.0)).unwrap().0.i.frames(), 2);
    }

    #[test]
    fn exact_times_of_images() {
        let scans = [4.0, 5.0, 6.0];
        let run = |frames, own: &OwnTimes, choice: Option<&str>| {
            let choice = choice.map(|text| frame_times(text).unwrap());
            times(frames, own, choice.as_ref(), &scans).map(|(times, _)| times)
        };
        let unknown = OwnTimes::Unknown;
        assert_eq!(run(3, &unknown, None).unwrap(), scans);
        assert_eq!(run(2, &unknown, Some("4-6")).unwrap(), [4.0, 6.0]);
        assert!(run(2, &unknown, None).unwrap_err().to_string().contains("--frame-times"));
        assert!(run(2, &unknown, Some("scans")).is_err() && run(2, &unknown, Some("own")).is_err());
        assert!(run(1, &unknown, Some("own")).is_err() && run(1, &unknown, None).is_ok());
        let since = OwnTimes::Since(vec![7.0, 7.5, 9.0]);
        assert_eq!(run(3, &since, Some("own")).unwrap(), [4.0, 4.5, 6.0]);
        assert!(run(3, &since, None).unwrap_err().to_string().contains("own times are not"));
        assert_eq!(run(3, &since, Some("scans")).unwrap(), scans);
        assert_eq!(run(3, &OwnTimes::Since(vec![1.0, 2.0, 3.0]), None).unwrap(), scans);
        assert!(run(3, &OwnTimes::Utc(vec![4.0, 5.0]), Some("own")).is_err());
    }
}
