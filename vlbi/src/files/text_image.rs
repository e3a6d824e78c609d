//! Images as eht-imaging's text: a heading with the field, and a line for each pixel.

use super::images::Pixels;
use super::{FileError, number};

/// Returns whether bytes begin like such an image.
pub fn is_text_image(bytes: &[u8]) -> bool {
    let heading = &bytes[..bytes.len().min(4096)];
    bytes.starts_with(b"# SRC:") && heading.windows(7).any(|word| word == b"# FOVX:")
}

/// Reads such an image: lines that start with `#`, of which `# FOVX: 100 pix 0.000160 as` and `# FOVY` tell the field (in
/// arcseconds), then lines of x and y (arcseconds to the east and to the north), Stokes I in Jy/pixel, and Q and U, or Q, U and
/// V, where they are known; rows from the north, each from the east.
///
/// # Errors
/// Names the line that is no pixel or out of order, and fields that are not square pixels.
pub fn parse(bytes: &[u8]) -> Result<Pixels, FileError> {
    let text = core::str::from_utf8(bytes)
        .map_err(|error| FileError::whole(format!("not UTF-8 text: {error}")))?;
    let [(width, wide_as), (height, high_as)] = [field(text, "FOVX:")?, field(text, "FOVY:")?];
    let mut places = Places { width, wide_as, first: None };
    let step_as = places.step_as();
    if (high_as / height as f64 - step_as).abs() > 1e-3 * step_as + ROUNDED_AS / height as f64 {
        return Err(FileError::whole("FOVX and FOVY are not those of square pixels"));
    }
    let mut planes: Vec<Vec<f64>> = Vec::new();
    let lines = (1..).zip(text.lines().map(str::trim));
    for (line, text) in lines.filter(|(_, text)| !text.is_empty() && !text.starts_with('#')) {
        let wrong = |message: String| FileError::line(line, message);
        let cells: Vec<f64> = text
            .split_ascii_whitespace()
            .map(|cell| number(cell, "a pixel's number"))
            .collect::<Result<_, _>>()
            .map_err(wrong)?;
        let [x, y, stokes @ ..] = &cells[..] else {
            return Err(wrong("x, y and Stokes I are expected".to_owned()));
        };
        if planes.is_empty() {
            planes = vec![Vec::new(); stokes.len()];
        }
        if ![1, 3, 4].contains(&stokes.len()) || stokes.len() != planes.len() {
            let count = cells.len();
            return Err(wrong(format!(
                "{count} numbers: 3 (x, y, I), 5 (Q, U) or 6 (V) in every line"
            )));
        }
        places.check(planes[0].len(), *x, *y).map_err(wrong)?;
        planes.iter_mut().zip(stokes).for_each(|(plane, value)| plane.push(*value));
    }
    let found = planes.first().map_or(0, Vec::len);
    if Some(found) != width.checked_mul(height) {
        return Err(FileError::whole(format!(
            "{found} pixels, FOVX and FOVY say {width} x {height}"
        )));
    }
    let mut planes = planes.into_iter();
    let values = planes.next().unwrap_or_default();
    let polarized = [planes.next(), planes.next(), planes.next()];
    Ok(Pixels {
        width,
        height,
        values,
        polarized,
        field_uas: Some(places.wide_as * 1e6),
        ..Pixels::default()
    })
}

/// Places of the pixels, rows from the north, each from the east.
struct Places {
    /// Pixels of a row.
    width: usize,
    /// Their field, arcseconds.
    wide_as: f64,
    first: Option<[f64; 2]>,
}

impl Places {
    fn step_as(&self) -> f64 {
        self.wide_as / self.width as f64
    }

    /// Explains why a place is not that of the next pixel. The first row tells the field.
    fn check(&mut self, pixel: usize, x: f64, y: f64) -> Result<(), String> {
        let (column, row) = (pixel % self.width, pixel / self.width);
        let [x0, y0] = *self.first.get_or_insert([x, y]);
        // eht-imaging rounds the field to a microarcsecond, which over many pixels may be more than one of them, and places to
        // 1e-10 arcseconds.
        if row == 0 && column > 0 {
            let field = (x0 - x) / column as f64 * self.width as f64;
            let apart = (field - self.wide_as).abs();
            let is_rounded = apart < 1e-3 * self.wide_as + ROUNDED_AS;
            // The farther apart places are, the better they tell it.
            if is_rounded && apart > 3.0 * PLACE_AS * self.width as f64 / column as f64 {
                self.wide_as = field;
            }
        }
        let step_as = self.step_as();
        let [right, down] = [x0 - column as f64 * step_as, y0 - row as f64 * step_as];
        // Places are rounded, but one that is out of order is off by a pixel or more.
        match (x - right).abs().max((y - down).abs()) > 0.25 * step_as {
            true => Err(format!(
                "x = {x}, y = {y}, where {right:.10}, {down:.10} is expected: rows from the north, each from the east, as FOVX and FOVY say"
            )),
            false => Ok(()),
        }
    }
}

/// Last digit of the field in a heading, arcseconds.
const ROUNDED_AS: f64 = 1e-6;
/// That of the places of pixels.
const PLACE_AS: f64 = 1e-10;

/// Pixels along a side, and its length in arcseconds.
fn field(text: &str, name: &str) -> Result<(usize, f64), FileError> {
    let lines = (1..).zip(text.lines());
    let mut named = lines.filter_map(|(line, text)| {
        Some((line, text.trim().strip_prefix('#')?.trim_start().strip_prefix(name)?))
    });
    let Some((line, said)) = named.next() else {
        return Err(FileError::whole(format!("has no line `# {name} N pix X as`")));
    };
    let cells: Vec<&str> = said.split_ascii_whitespace().collect();
    let parsed = match cells[..] {
        [count, "pix", size, "as"] => count.parse().ok().zip(size.parse().ok()),
        _ => None,
    };
    match parsed {
        Some((count @ 1..=1_000_000, size)) if size > 0.0 && f64::is_finite(size) => {
            Ok((count, size))
        }
        _ => {
            let said: String = said.trim().chars().take(40).collect();
            let message =
                format!("{name} `{said}` is not `N pix X as`, N pixels over X arcseconds");
            Err(FileError::line(line, message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "# SRC: SgrA \n# RA: 17 h 45 m 40.0409 s\n# DEC: -28 deg 59 m 31.8820 s\n# MJD: 48277.0000 \n\
        # RF: 230.0000 GHz \n# FOVX: 2 pix 0.000004 as \n# FOVY: 3 pix 0.000006 as \n# ---\n\
        # x (as)     y (as)       I (Jy/pixel)  Q (Jy/pixel)  U (Jy/pixel)\n";

    /// Rows from the north, in Jy/pixel.
    fn lines(stokes: &str) -> String {
        let places = [(2, 3), (0, 3), (2, 1), (0, 1), (2, -1), (0, -1)];
        let line = |(k, (x, y)): (usize, &(i32, i32))| format!("{x}e-6 {y}e-6 {k}.5{stokes}\n");
        places.iter().enumerate().map(line).collect()
    }

    #[test]
    fn exact_pixels_in_their_places() {
        let text = HEAD.to_owned() + &lines(" 0.25 -0.125");
        assert!(is_text_image(text.as_bytes()) && !is_text_image(b"1,2\n3,4\n"));
        let pixels = parse(text.as_bytes()).unwrap();
        assert_eq!((pixels.width, pixels.height), (2, 3));
        assert_eq!(pixels.values, [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]);
        assert_eq!(pixels.polarized, [Some(vec![0.25; 6]), Some(vec![-0.125; 6]), None]);
        assert!((pixels.field_uas.unwrap() - 4.0).abs() < 1e-12);
        let alone = parse((HEAD.to_owned() + &lines("")).as_bytes()).unwrap();
        assert_eq!(alone.polarized, [None, None, None]);
        let all = parse((HEAD.to_owned() + &lines(" 1 2 3")).as_bytes()).unwrap();
        assert_eq!(all.polarized[2], Some(vec![3.0; 6]));
    }

    /// A heading rounds fields to 1 µas, and places of pixels to 1e-4 µas: many narrow pixels tell the field all the same.
    #[test]
    fn exact_fields_are_those_of_the_pixels() {
        for (width, field) in [(200u32, 126.6), (512, 126.9), (2048, 95.3), (3, 100.0)] {
            let step = field / f64::from(width);
            let heading = format!("{width} pix {:.6} as", 1e-6 * field);
            let head = HEAD.replace("2 pix 0.000004 as", &heading);
            let heading = format!("16 pix {:.6} as", 16e-6 * step);
            let mut text = head.replace("3 pix 0.000006 as", &heading);
            for k in 0..16 * width {
                let [x, y] = [(k % width, width), (k / width, 16)]
                    .map(|(at, of)| step * (f64::from(of) / 2.0 - 0.5 - f64::from(at)));
                text += &format!("{:15.10} {:15.10} {k}\n", 1e-6 * x, 1e-6 * y);
            }
            let pixels = parse(text.as_bytes()).unwrap();
            assert_eq!(pixels.values.len(), 16 * width as usize);
            assert!((pixels.field_uas.unwrap() - field).abs() < 4e-4, "{:?}", pixels.field_uas);
        }
    }

    #[test]
    fn exact_errors_name_the_line() {
        let good = HEAD.to_owned() + &lines("");
        for (from, to, says) in [
            ("2 pix", "3 pix", "square"),
            ("0e-6 3e-6", "4e-6 3e-6", "line 11: x = 0.000004"),
            ("0.5", "x", "line 10: a pixel's number `x`"),
            ("0.5", "0.5 1", "line 10: 4 numbers"),
            ("1.5", "1.5 1 2", "line 11: 5 numbers"),
            ("0e-6 -1e-6 5.5\n", "", "5 pixels"),
            ("2 pix 0.000004 as", "two pix", "line 6: FOVX: `two pix`"),
            ("# FOVY", "# FOV", "# FOVY:"),
        ] {
            assert!(good.contains(from), "{from}");
            let message = parse(good.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
